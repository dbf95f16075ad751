"""The report's HTML as text: well formed, hostile names harmless, everything readable in it, nothing fetched."""

from __future__ import annotations

import base64
import copy
import gzip
import json
import re
from html.parser import HTMLParser

import pytest

from fcdm_opt.show.rendering import environment, sentence, unbroken
from fcdm_opt.show.report.page import page
from fcdm_opt.show.texts import shown

HOSTILE = "</script><b>\"'&{{js}}"
MOST = 3_000_000  # bytes of a report
VOID = {"meta", "link", "input", "br", "img", "hr"}
AT_REST = {
    "sizes": [1.0, 1.0],
    "transform": None,
    "curve": [[0.8, 1.2, 1.2, 0.8, 0, 0]],
    "switching": [],
    "contacts": [],
    "contact": [],
    "target": [1.02, 1.02],
    "rho": None,
    "status": None,
    "usable": None,
    "motion": "none",
    "amount": 0.0,
    "pair_gap": 0.1,
    "pair_state": "apart",
    "parameters": [],
    "note": "",
}


def body(name: str, role: str) -> dict:
    return {
        "name": name,
        "role": role,
        "vertices": 4,
        "parts": 1,
        "seed": [0.0, 0.0, 0.0],
        "notes": [],
        "deviation": 0.0,
    }


def case(name: str, asked: str = "A (+,+)", text: str = "plain") -> dict:
    """A case with every kind of text in it."""
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    solid = {"points": corners, "triangles": [[0, 1, 2]], "edges": [[0, 1]], "seed": [0.2, 0.2, 0.2]}
    return {
        "file": 0,
        "name": name,
        "asked": asked,
        "goal": "beyond",
        "wanted": "beyond",
        "limits": "",
        "status": "PAIR_OVERLAPS",
        "outside": "",
        "extents": [[f"one {text}", "1 x 2 x 3", "1.02 x 2.04 x 3.06", "1.02"]],
        "outcome": "does not fit",
        "told": [f"Advice {text}"],
        "settled": [f"Settled {text}"],
        "verdict": f"move it {text}",
        "fit": f"clearance {text}",
        "picture": {
            "scene": "<svg></svg>",
            "insets": ["<svg></svg>"],
            "high": 2.0,
            "key": [("swatch", "var(--movable)", text), ("1", "", text)],
        },
        "sizes": [
            {
                "name": f"width {text}",
                "body": text,
                "what": "+x by 1",
                "low": "-0.1",
                "high": "0",
                "off": "-0.2",
                "drawn": "8",
                "made": "7.8",
                "beyond": True,
            }
        ],
        "off_drawn": f"width {text} -0.2",
        "beyond": f"made beyond the tolerance: width {text} -0.2; the stack-up holds within the tolerances",
        "stack": {
            "worst": [{"what": "least", "gap": 0.1, "at": [[f"width {text}", -0.1]]}],
            "spread": {"what": "Root sum square", "ends": [0.0, 0.2]},
            "beyond": [False, True],
            "shares": [{"size": text, "half": 0.05, "coefficient": -0.5, "worst": 1.0, "variance": None}],
            "notes": [f"not counted {text}"],
            "yield": {"what": "fit", "limits": "of at least 0", "share": "99.00%", "of": "of 100 pairs drawn"},
            "chart": "<svg></svg>",
        },
        "unit": "",
        "amount_unit": "",
        "doubt": "",
        "tracking": True,
        "usable": True,
        "motion": f"TZ 0.25 {text}",
        "amount": 0.25,
        "lower_bound": 0.2499,
        "gap": 4e-4,
        "least": {"text": "0.2499", "near": "gap 4e-04"},
        "published": {"motion": f"published {text}", "amount": 0.3},
        "touch_amount": 0.1,
        "parameters": [{"name": f"TZ {text}", "value": 0.25, "unit": "length", "shown": "0.25"}],
        "pair": [1.02, 1.02],
        "pair_gap": -0.01,
        "pair_state": "overlapping",
        "rho": [1.02, 1.03],
        "features": [f"V1F2(P1V6; P2V2,V3,V5) {text}"],
        "active": [f"active {text}"],
        "stage": "1: closed form",
        "seconds": {"solve": 0.01},
        "sha256": "0" * 64,
        "bodies": [body(f"one {text}", "movable"), body(f"two {text}", "static")],
        "left_out": [f"left out {text}"],
        "certificate": {
            "passed": False,
            "checks": [
                {"name": f"check of {name}", "passed": True, "value": 1e-15, "limit": 1e-9, "note": f"note {text}"},
                {"name": "second", "passed": False, "value": None, "limit": "inf", "note": ""},
            ],
        },
        "evidence": {"bound": 0.2499, "text": f"evidence {text}", "checked": True, "covers": f"yes {text}"},
        "sensitivities": {
            "text": f"derivatives {text}",
            "most": {
                "name": f"size {text}",
                "value": 0.5,
                "unit": "+1 %",
                "about": True,
                "outcome": "",
                "note": f"of {text}",
            },
            "bars": [
                {"name": f"size {text}", "value": 0.5, "unit": "+1 %", "note": f"of {text}"},
                {"name": "other", "value": -0.25, "unit": "+1 %", "note": ""},
                {"name": "none", "value": None, "unit": "+1 %", "note": ""},
            ],
        },
        "scene": {
            "size": 1.0,
            "view": [20.0, -60.0],
            "objects": [{"body": k, "name": f"b{k} {text}", **solid} for k in (0, 1)],
        },
        "feature_shapes": [],
        "labels": [f"label {text}"],
        "axes": {"box": [[0.8, 3.0], [0.8, 3.0]], "window": [[0.9, 1.1], [0.9, 1.1]]},
        "nominal": [1.0, 1.0],
        "tolerance_box": [[0.98, 1.02], [0.98, 1.02]],
        "signs": [1.0, 1.0],
        "quadrant": True,
        "poses": {"nominal": AT_REST, "rescaled": AT_REST, "corrected": None, "tracked": None},
        "families": {"tolerance": None, "motion": None},
    }


def payload(text: str = "plain") -> dict:
    cell = {
        "case": 0,
        "motion": f"TZ 0.25 {text}",
        "amount": 0.25,
        "amount_unit": "",
        "doubt": "",
        "lower_bound": 0.2499,
        "least": {"text": "0.2499", "near": "gap 4e-04"},
        "published": f"published {text}",
        "pair_state": "overlapping",
        "status": "PAIR_OVERLAPS",
        "outside": "",
        "usable": True,
        "note": f"note {text}",
    }
    none = {"case": None, "amount": None, "status": "INFEASIBLE", "published": None, "note": f"note {text}"}
    none |= {"verdict": "does not fit: 20.1 in 20.0", "outcome": "does not fit"}
    return {
        "title": f"Title {text}",
        "note": f"First {text}.\n\nSecond.",
        "made": {"date": "2026-01-01", "fcdm_opt": f"0.1 {text}"},
        "tolerances": [["planarity", 1e-12, f"meaning {text}"]],
        "files": [
            {"file": f"a{text}.toml", "title": f"File {text}", "note": text, "sha256": "1" * 64, "cases": [0, 1]},
            {"file": "b.toml", "title": "", "note": "", "sha256": "2" * 64, "cases": [], "error": f"wrong {text}"},
        ],
        "matrices": [
            {
                "file": 0,
                "title": f"cases {text}",
                "tolerance": "2 %",
                "cells": {"A": cell, "B": none, "C": none, "D": {**cell, "case": 1}},
            }
        ],
        "cases": [case("first", text=text), case(f"second {text}", asked="target 1, 2", text=text)],
    }


class Reader(HTMLParser):
    """Collects elements and text, and refuses tags that do not close in order."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[tuple[str, str]] = []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open[-1] == tag, f"</{tag}> closes <{self.open[-1]}>"
        self.open.pop()

    def handle_data(self, data):
        self.text.append((self.open[-1] if self.open else "", data))


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert reader.open == []
    return reader


def visible(reader: Reader) -> str:
    return " ".join("".join(text for tag, text in reader.text if tag not in ("script", "style")).split())


def packed(html: str, name: str) -> str:
    found = re.search(rf'id="packed-{name}">([A-Za-z0-9+/=]+)</script>', html)
    assert found
    return gzip.decompress(base64.b64decode(found[1])).decode()


@pytest.fixture(scope="module")
def plain() -> str:
    return page(payload())


def test_tags_close_in_order_and_ids_are_unique(plain):
    reader = read(plain)
    ids = [attributes["id"] for _, attributes in reader.elements if "id" in attributes]
    assert len(ids) == len(set(ids)) > 20
    for _, attributes in reader.elements:  # what is referred to is there
        for key in ("for", "aria-labelledby", "aria-describedby"):
            assert attributes.get(key) is None or attributes[key] in ids
        if (attributes.get("href") or "").startswith("#"):
            assert attributes["href"][1:] in ids


def test_hostile_names_stay_text(plain):
    harmless, hostile = read(plain), read(page(payload(HOSTILE)))
    assert [tag for tag, _ in hostile.elements] == [tag for tag, _ in harmless.elements]
    assert [sorted(a) for _, a in hostile.elements] == [sorted(a) for _, a in harmless.elements]
    words = visible(hostile)
    for text in ("Advice", "left out", "note", "evidence", "Derivatives", "meaning", "wrong", "Title", "published"):
        assert f"{text} {HOSTILE}" in words


def test_nothing_is_fetched(plain):
    reader = read(plain)
    for tag, attributes in reader.elements:
        assert tag not in ("iframe", "object", "embed", "base", "img")
        for key in ("src", "href", "action", "data", "srcset"):
            assert (attributes.get(key) or "#").startswith(("#", "data:")), (tag, attributes)
    styles = "".join(text for tag, text in reader.text if tag == "style")
    assert "url(" not in styles
    assert "@import" not in styles
    policy = next(a["content"] for tag, a in reader.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert "default-src 'none'" in policy
    assert not re.search(r"https?:", policy)


def test_every_case_has_answer_and_certificate_without_scripts(plain):
    words = visible(read(plain))
    for name in ("first", "second plain"):
        assert f"check of {name}" in words
    assert words.count("No motion") == 0
    assert words.count("1 of 2 checks hold") == 2
    assert "for requirement A (+,+), goal" in words
    assert "for target 1, 2, goal" in words
    assert "overlapping by 0.01" in words
    assert "wrong plain" in words


def test_requirements_stand_as_in_the_papers_tables(plain):
    matrix = plain[plain.index('<table class="matrix"') :]
    matrix = matrix[: matrix.index("</table>")]
    assert re.findall(r'class="letter">(\w)<', matrix) == ["A", "C", "B", "D"]
    assert re.findall(r'href="#case-(\d)"', matrix) == ["0", "1"]
    assert "does not fit: 20.1 in 20.0" in matrix  # of a case with no answer of its own on the page


def test_what_a_case_says_stood_four_times_on_the_page():
    data = payload()
    data["cases"][0] |= {"verdict": "does not fit: 20.1 in 20.0", "amount": None, "told": ["choose other sizes"]}
    data["matrices"][0]["cells"] = {
        letter: {**cell, "case": 0, "amount": None, "verdict": "does not fit: 20.1 in 20.0", "outcome": "does not fit"}
        for letter, cell in data["matrices"][0]["cells"].items()
    }
    words = visible(read(page(data)))
    assert words.lower().count("does not fit: 20.1 in 20.0") == 1
    assert words.count("Choose other sizes.") == 1


def test_sizes_beyond_their_tolerance_were_told_on_each_sheet():
    data = payload()
    data["cases"] = [{**data["cases"][0], "name": name} for name in ("wide", "narrow")]
    data["cases"][1]["beyond"] = ""
    data["files"][0]["cases"], data["matrices"] = [0, 1], []
    words = visible(read(page(data)))
    assert words.lower().count("made beyond the tolerance") == 1
    assert "* wide: made beyond the tolerance: width plain -0.2; the stack-up holds within the tolerances." in words
    assert "wide</a>\u00a0*" in page(data)  # the mark that this explains
    assert "narrow</a>\u00a0*" not in page(data)
    data["cases"] = data["cases"][:1]  # without a table of cases it stands with the answer
    data["files"][0]["cases"] = [0]
    assert visible(read(page(data))).count("Made beyond the tolerance: width plain -0.2; the stack-up holds") == 1


def test_checks_that_hold_were_counted_under_a_motion_that_leaves_the_fit():
    data = payload()
    data["cases"][0] |= {"outside": "outside the fit", "motion": "none"}
    told = page(data).split('<div class="told">')[1].split('<div class="sizes">')[0]
    assert "outside the fit" in told
    assert "checks hold" not in told


def test_words_on_a_sheet_were_explained_that_it_does_not_use():
    data = payload()
    data["cases"] = [{**data["cases"][0], "outside": "outside the fit", "asked": "made width -0.2", "goal": "touch"}]
    data["files"][0]["cases"], data["matrices"] = [0], []
    words = page(data).split('<p class="paper words">')[1].split("</p>")[0]
    assert re.findall("<b>(.*?)</b>", words) == ["touch"]
    data["cases"][0] |= {"outside": "", "pair": [1.0, 1.0]}
    words = page(data).split('<p class="paper words">')[1].split("</p>")[0]
    assert re.findall("<b>(.*?)</b>", words) == ["touch", "amount", "pair made", "proved"]


def test_checks_stood_open_below_an_answer(plain):
    assert plain.count("<summary>Checks of the judge (2)</summary>") == plain.count('<article class="case"')


def test_why_there_is_no_stack_up_was_said_once_a_case():
    data = payload()
    stack = {"notes": ["no stack-up: it takes long"]}
    data["cases"] = [{**data["cases"][0], "name": name, "stack": stack} for name in "AB"]
    data["files"][0]["cases"], data["matrices"] = [0, 1], []
    assert visible(read(page(data))).count("No stack-up: it takes long.") == 1
    data["cases"][1]["stack"] = None
    assert "No stack-up: it takes long (cases A)." in visible(read(page(data)))


def test_a_stack_up_that_the_judge_refused_is_headed_by_that():
    data = payload()
    data["cases"][0]["stack"] |= {"failed": "NOT VERIFIED, do not use it: failed gap"}
    words = visible(read(page(data)))
    words = words[words.index("Stack-up of the gap") :]
    assert words.index("NOT VERIFIED") < words.index("What is struck below is wrong") < words.index("Worst case")


def test_numbers_of_a_stack_up_that_the_judge_refused_stood_in_bold():
    """Struck, and without their picture; those of a case that it passed are not."""
    data = payload()
    data["cases"][1]["stack"] |= {"failed": "NOT VERIFIED, do not use it: failed gap"}  # no more that of case A
    good, bad = re.findall(r'<section class="(stack[^"]*)"[^>]*>(.*?)</section>', page(data), re.DOTALL)
    assert [own[0] for own in (good, bad)] == ["stack", "stack refused"]
    assert ["How the gap is spread" in own[1] for own in (good, bad)] == [True, False]
    rules = page(data).split("<style>")[1].split("</style>")[0]
    assert re.search(r"\.refused :is\(dd[^}]*line-through", rules)
    assert 'class="refused"' not in page(data)
    data["cases"][0] |= {"status": "NOT_VERIFIED", "usable": False}
    struck = re.findall(r'<div class="refused"><dt>(.*?)</dt>', page(data))
    assert [re.sub("<[^>]*>", "", own) for own in struck] == ["Motion", "Amount", "Proved at least", "Pair made"]


def test_a_verdict_of_several_sentences_ran_on():
    data = payload()
    data["cases"][0]["verdict"] = "move one 1 mm along +x; move two 2 mm along -x: then both touch; proved"
    big = page(data).split('<p class="big">')[1].split("</p>")[0]
    lines = [re.sub("<[^>]*>", "", text).strip() for text in big.split("</span>\n")]
    assert lines == ["Move one 1 mm along +x;", "Move two 2 mm along -x:", "then both touch;", "proved.", ""]
    data["files"][1]["error"] = "case 'A': wrong\ncase 'B': wrong too"
    listed = [f"<li><b>b.toml</b>: case &#39;{case}</li>" for case in ("A&#39;: wrong", "B&#39;: wrong too")]
    assert "".join(listed) in page(data)


def test_what_matters_most_was_told_with_a_negative_amount():
    data = payload()
    most = data["cases"][0]["sensitivities"]["most"]
    for value, told in ((-0.07678, "0.07678 less"), (0.5, "0.5 more")):
        data["cases"][0]["sensitivities"]["most"] = {**most, "value": value, "about": False, "outcome": ""}
        assert f"amount {told}" in visible(read(page(data)))


def test_one_sensitivity_is_a_sentence_and_no_chart():
    data = payload()
    for own in data["cases"]:
        own["sensitivities"]["bars"][1]["value"] = 0.0
    words = visible(read(page(data)))
    assert words.count("Only the size plain: +0.5 for +1 % (of plain).") == 2
    assert "left of the middle less" not in words


def test_the_stack_up_stands_with_the_answer_and_marks_what_is_beyond_the_worst_case():
    data = payload()
    data["cases"][1]["stack"] = None
    sheet = page(data).split("<article")[1]
    assert "What each size contributes to the gap" in sheet
    assert "Root sum square" in sheet
    assert "+0 to +0.2\u00a0*" in sheet


def test_a_stack_up_of_several_cases_stood_in_each(plain):
    """Once, and each case has a link to it with the least gap; one of a case by itself stays with that."""
    assert plain.count("What each size contributes to the gap</caption>") == 1
    sheets = plain.split("<article")[1:3]
    (place,) = {own for sheet in sheets for own in re.findall(r'<a href="#(stack-\d+)">', sheet)}
    assert plain.count(f'id="{place}"') == 1
    assert "Of cases" not in plain
    data = payload()
    data["cases"].append({**data["cases"][0], "name": "other", "stack": {**data["cases"][0]["stack"], "unit": "in"}})
    data["files"][0]["cases"] = [0, 1, 2]
    three = page(data)
    assert three.count("What each size contributes to the gap</caption>") == 2
    assert "What each size contributes" in three.split("<article")[3]
    assert "Of cases first and second plain." in visible(read(three))
    notes = "it is the gap of the two bodies", "a sentence of all"  # of one with a keep-out
    data["cases"][1]["stack"] = {**data["cases"][0]["stack"], "notes": [notes[1], notes[0]]}
    data["cases"][0]["stack"] = data["cases"][2]["stack"] = {**data["cases"][0]["stack"], "notes": [notes[1]]}
    once = page(data)
    assert once.count("What each size contributes to the gap</caption>") == 1
    assert [visible(read(once)).count(own[1:]) for own in notes] == [1, 1]


def test_what_was_checked_of_what_is_impossible_is_said():
    data = payload()
    covers = "yes, by separate code: no motion at all does"
    proof = {"bound": None, "text": "", "checked": True, "covers": covers}
    data["cases"][0] |= {"amount": None, "status": "INFEASIBLE", "evidence": proof}
    assert covers in visible(read(page(data)))


def test_a_case_without_motion_says_so():
    none = payload()
    none["cases"] = [{**case("stuck"), "amount": None, "motion": "-", "status": "INFEASIBLE", "certificate": None}]
    none["cases"][0] |= {
        "lower_bound": None,
        "gap": None,
        "least": {"text": "impossible", "near": ""},
        "pair_state": "apart",
    }
    none["cases"][0] |= {"sensitivities": None, "published": None, "touch_amount": None, "rho": None}
    none["files"] = none["files"][:1]
    none["files"][0]["cases"], none["matrices"] = [0], []
    words = visible(read(page(none)))
    assert "Move it plain" in words  # what is the reason is said as the command line says it
    assert "proof checked" in words
    assert "Advice plain." in words
    assert "at rest, at" in words  # the state is not that after a motion


def test_a_table_of_all_cases_where_no_table_of_requirements_has_them():
    """Half of the first screen was blank."""
    data = payload() | {"matrices": []}
    words = page(data)
    table = words[words.index("All cases") : words.index('<section id="viewer"')]
    assert re.findall(r'href="#case-(\d)"', table) == ["0", "1"]
    assert "move it plain" not in table  # it has a motion: "TZ 0.25"
    assert "TZ 0.25 plain" in table


def test_a_sheet_on_paper_is_known_by_its_title_block():
    """Its revision was a digest of the case, which no tool for files gives."""
    words = visible(read(page(payload())))
    for told in ("aplain.toml, case first", "2026-01-01", "111111111111 (start of the file's SHA-256)", "Approved"):
        assert told in words
    assert "Numerical tolerances of solver and judge (1)" in words  # not the parts'


def test_nothing_read_is_a_page_too():
    empty = payload() | {"cases": [], "matrices": []}
    empty["files"] = [{**file, "cases": []} for file in empty["files"]]
    assert "wrong plain" in visible(read(page(empty)))


def test_figures_and_plotly_come_back_as_they_were(plain):
    from plotly.offline import get_plotlyjs

    assert packed(plain, "plotly") == get_plotlyjs()
    figures = json.loads(packed(plain, "figures"))["cases"]
    for drawn, given in zip(figures, payload()["cases"], strict=True):
        assert drawn["poses"] == given["poses"]
        assert drawn["scene"] == given["scene"]
    assert "Licensed under the MIT license" in plain[: plain.index("<body>")]


def test_same_payload_same_page_of_bounded_size(plain):
    assert page(copy.deepcopy(payload())) == plain
    assert len(plain.encode()) < MOST


def test_numbers_that_json_does_not_have_are_refused():
    broken = payload()
    broken["cases"][0]["nominal"] = [float("nan"), 1.0]
    with pytest.raises(ValueError, match="JSON"):
        page(broken)


def test_longest_bar_fills_its_half(plain):
    bars = re.findall(r'class="bar (more|less)" style="left:([\d.]+)%;width:([\d.]+)%"', plain)
    assert bars == [("more", "50.00", "50.00"), ("less", "25.00", "25.00")] * 2


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "\u2013"),
        (True, "yes"),
        (0.1 + 0.2, "0.3"),
        ([1, 2.5], "1, 2.5"),
        ([], "\u2013"),
        ("<", "<"),
        (7, "7"),
    ],
)
def test_values_as_text(value, text):
    assert shown(value) == text


def test_marks_say_it_in_words():
    yes_no = environment().get_template("pieces.html").module.yes_no
    told = [re.sub("<[^>]+>", "", yes_no(x)) for x in (True, False, None)]
    assert told == ["✓&nbsp;yes", "✗&nbsp;no", "○&nbsp;not asked"]


@pytest.mark.parametrize(
    ("text", "told"),
    [("open by 2 mm", "Open by 2 mm."), ("ribs: 2 solids", "ribs: 2 solids."), ("Choose others.", "Choose others.")],
)
def test_sentences_stood_without_a_full_stop(text, told):
    assert sentence(text) == told


def test_a_table_without_rows_is_left_out():
    assert environment().get_template("pieces.html").module.table("caption", ("a",), []).strip() == ""


def test_lines_ended_behind_the_sign_of_a_direction() -> None:
    assert unbroken("0.5 along -x (facing -y), a-b, -0.25 <") == (
        '0.5 along <span class="whole">-x</span> (facing <span class="whole">-y</span>), a-b, '
        '<span class="whole">-0.25</span> &lt;'
    )
    for text in ("-0.06 mm", "0.06 mm", "-2.5 deg", "0.5"):  # "mm" stood on the next line
        assert unbroken(f"TZ {text}, amount 1 mm") == f'TZ <span class="whole">{text}</span>, amount 1 mm'
