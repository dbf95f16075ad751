"""The cards that notebooks show: whole pieces of HTML with the right numbers, whatever is in them."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.units import floored
from fcdm_opt.problem.solution import Check
from fcdm_opt.show.cards import Card, card_of, curve_card
from fcdm_opt.show.texts import number

PROBLEMS = Path(__file__).parents[2] / "problems"
TAGS = frozenset(re.findall(r"\w+", "div span strong b s table tbody tr th td ul li img"))
ATTRIBUTES = frozenset(("style", "scope", "src", "alt"))
WILD = "<script>alert(\"1\")</script> & 'more' \x00\ud800"
LARGEST = 80_000  # a picture takes most of it


class Reader(HTMLParser):
    """Reads a card strictly: known tags and attributes only, every tag closed in its turn."""

    def __init__(self, card: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.text: list[str] = []
        self.marks: list[tuple[str, dict[str, str]]] = []
        self.feed(card)
        self.close()
        assert not self.open, f"left open: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag != "img":
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in TAGS, tag
        assert {name for name, _ in attrs} <= ATTRIBUTES, attrs
        given = dict(attrs)
        picture = given.pop("src", None) or ""
        assert (tag == "img") == picture.startswith("data:image/png;base64,"), "something from outside"
        assert not any("url" in (value or "") or "//" in (value or "") for value in given.values()), attrs
        assert not re.search(r"(?<!-)(background|color):", dict(attrs).get("style") or ""), "a colour of the page"
        self.marks.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def handle_comment(self, data: str) -> None:
        pytest.fail(f"a comment: {data}")

    @property
    def words(self) -> str:
        return " ".join(self.text)


def read(shown: Any) -> Reader:
    """Read the card of a result, or of what stands on one."""
    card = shown.html if isinstance(shown, Card) else shown._repr_html_()
    assert len(card.encode()) < LARGEST
    return Reader(card)


def probe_problem(name: str = "probe", **changes: Any) -> fo.Problem:
    tip = [(0, 0, 0), (1, 1, 2), (1, -1, 2), (-1, 1, 2), (-1, -1, 2)]
    slab = [(x, y, z) for x in (-3, 3) for y in (-3, 3) for z in (-1, 0)]
    probe, table = (fo.Body.convex(v, seed="box", name=name) for v in (tip, slab))
    asked = {"tolerance": 0.02, "requirement": "B", "motion": fo.Translation("z"), "goal": "touch"}
    return fo.Problem(probe, table, name=name, **{**asked, **changes})


@pytest.fixture(scope="module")
def solution() -> fo.Solution:
    return fo.solve(probe_problem())


@pytest.fixture(scope="module")
def example() -> fo.Solution:
    return fo.solve(fo.load_problems(PROBLEMS / "example1.toml")[1])


def test_curve_is_drawn_and_its_features_are_listed(example: fo.Solution) -> None:
    curve = example.problem.curve
    reader = read(curve)
    assert [own["alt"] for tag, own in reader.marks if tag == "img"] == ["decision curve, 5 segments"]
    for segment in curve.segments:
        assert segment.feature.label in reader.words
    numbers = [word for word in ("SW1", "SW2", "SW3", "SW4", "SW5") if word in reader.words]
    assert numbers == ["SW1", "SW2", "SW3", "SW4"]


def test_solution_shows_what_it_holds(solution: fo.Solution, example: fo.Solution) -> None:
    words = read(solution).words
    for text in (
        "\u2713 solved",
        "Move probe 0.01 along +z: then its corner 1 touches the top face (facing +z) of probe; smallest possible",
        "0.01",
        "exact",
        "touching",
        "V1F2(P1V1; P2V2,V4,V6,V8)",
        "yes, 19 checks",
    ):
        assert text in words
    reader = read(example)
    expected = [
        "! pair overlaps",
        example.status.value,
        f"{example.amount:.4g}",
        f"{math.degrees(example.parameters['RZ']):.4g}",
        "overlapping",
        f"{example.pair_gap:.4g}",
        "relative gap 0.01",
        *(own.label for own in example.features),
    ]
    for text in expected:
        assert text in reader.words


def test_certificate_lists_every_check(solution: fo.Solution) -> None:
    certificate = fo.verify(solution)
    words = read(certificate).words
    assert "19 of 19 checks passed" in words
    assert all(check.name in words for check in certificate.checks)
    wrong = fo.verify(replace(solution, amount=solution.amount * 2))
    words = read(wrong).words
    assert "\u2717 not passed" in words
    assert words.index("\u2717 failed") < words.index("\u2713 passed")
    assert wrong.failed[0].name in words


def test_certificate_of_nothing() -> None:
    assert "\u2717 not passed" in read(fo.Certificate(())).words
    wild = [Check(f"check {k}", False, math.nan, math.inf, "long " * 1000) for k in range(1000)]
    reader = read(fo.Certificate(tuple(wild)))
    assert "infinite" in reader.text
    assert "-" in reader.text
    assert "and 970 more" in reader.text


def test_study_counts_its_points(tmp_path: Path) -> None:
    study = fo.Study(probe_problem(), {"tolerance": [0.01, 0.02, 0.03]}, title=WILD, budget=0.012)
    result = fo.run_study(study, tmp_path, jobs=1)
    words = read(result).words
    for text in ("\u2713 complete", "0.005", "0.01", "0.015", "66.67%", "2 of 3", "3 solved", "tolerance: 3 values"):
        assert text in words
    pending = replace(result, points=(*result.points, (None, {"tolerance": 0.04})))
    assert "! 1 not worked out yet" in read(pending).words
    assert "3 pending" in read(replace(result, answers={})).words


def test_names_are_text(tmp_path: Path) -> None:
    """What a user wrote is shown as written, and is never a tag."""
    solution = fo.solve(probe_problem(WILD))
    problem = solution.problem
    everything = [problem, problem.movable, problem.curve, solution, solution.certificate, fo.whatif(solution)]
    named = 0
    for shown in everything:
        reader = read(shown)
        named += "<script>alert(\"1\")</script> & 'more' \ufffd" in reader.words
    assert named == 4  # a certificate and a what-if name no body


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_other_cards_show_their_numbers(solution: fo.Solution) -> None:
    what = fo.whatif(solution, tolerance=0.03)
    assert "0.01 to 0.015" in read(what).words
    turning = fo.coherent_range(probe_problem(motion=fo.Translation("z") >> fo.Rotation("y"), goal="at"), {"RY": 1.0})
    words = read(turning).words
    assert f"{math.atan(2.0):.9g}" in words
    assert "\u2713 proved" in words
    turned = fo.whatif(solution, motion=fo.Translation("z") >> fo.Rotation("y"))
    assert "deg" in read(turned).words
    gaps = read(fo.clearances(solution.problem)).words  # 0.02 + 0.01 either way
    assert "-0.03 to 0.03" in gaps
    assert "! overlapping at some sizes" in gaps
    best = fo.best_pose(solution.problem)
    assert "least worst gap" in read(best).words
    assert "<s " not in card_of(best)
    refused = replace(best, checks=(replace(best.checks[0], passed=False), *best.checks[1:]))
    assert f"NOT VERIFIED, do not use it: failed {best.checks[0].name}" in read(refused).words
    struck = re.findall(r"<s [^>]*>(.*?)</s>", card_of(refused))  # they stood in bold
    assert number(best.worst_gap) in struck
    assert "no" not in struck
    shifts = fo.compensation_map(solution.problem, error=1e-2)
    assert f"{len(shifts.table)}" in read(shifts).words
    share = fo.assembly_yield(shifts, sizes=(fo.Uniform(0.99, 1.01), fo.Uniform(0.99, 1.01)), budget=0.02, count=1000)
    assert "100.00% pass" in read(share).words


def test_no_motion(solution: fo.Solution) -> None:
    stuck = fo.solve(probe_problem(limits={"TZ": (-1.0, 0.001)}))
    words = read(stuck).words
    assert "\u2717 impossible" in words
    assert "impossible" in words
    assert "no motion to verify" in words
    nothing = replace(
        solution, amount=math.nan, lower_bound=math.nan, rho=None, transform=None, parameters={}, pair_gap=math.inf,
        certificate=None, features=(), seconds={}, status=fo.Status.NOT_FOUND, stage="",
    )  # fmt: skip
    assert "\u2717 no motion found" in read(nothing).words


@pytest.mark.slow
@pytest.mark.parametrize("name", ["peg_square", "lid", "bracket_stuck"])
def test_unions_and_keep_outs(name: str) -> None:
    problem = fo.load_problems(PROBLEMS / f"{name}.toml")[0]
    solution = fo.solve(problem)
    for shown in (problem, problem.static, problem.curve):
        assert problem.static.name in read(shown).words
    reader = read(solution)
    assert {"peg_square": "solved", "lid": "solved", "bracket_stuck": "impossible"}[name] in reader.words
    assert all(own.name in read(problem).words for own in problem.keep_out)
    assert sum(tag == "img" for tag, _ in reader.marks) == 1


def test_no_contact_in_the_box() -> None:
    problem = probe_problem()
    curve = fo.decision_curve(problem.movable, problem.static, box=((0.1, 0.2), (0.1, 0.2)))
    reader = read(curve)
    assert "apart" in reader.words
    assert "none in the box" in reader.words
    assert not any(tag == "img" for tag, _ in reader.marks)
    read(replace(curve, box=((0.0, np.inf), (0.0, np.inf))))


def test_thousands_of_segments() -> None:
    """A curve of very many pieces is listed in part, and drawn without names in a moment."""
    count = 5000
    angles = np.linspace(0.0, np.pi / 2.0, count + 1)
    corners = 0.8 + 2.2 * np.column_stack([np.sin(angles), np.cos(angles)])
    feature = SimpleNamespace(label="F1F2(P1" + ",".join(f"V{k}" for k in range(3000)) + "; P2V1,V2,V3)")
    segments = tuple(
        SimpleNamespace(start=a, end=b, snug=k > 4000, index=k + 1, feature=feature, configuration="F-F")
        for k, (a, b) in enumerate(pairwise(corners))
    )
    points = tuple(SimpleNamespace(rho=p, index=k, label=feature.label, kind="V1E2") for k, p in enumerate(corners))
    curve: Any = SimpleNamespace(
        segments=segments, switching_points=points, branches=(SimpleNamespace(segments=segments),), status="contact",
        gap=lambda _: 0.0,
        box=((0.8, 3.0), (0.8, 3.0)), movable=SimpleNamespace(name="a"), static=SimpleNamespace(name="b"),
    )  # fmt: skip
    reader = read(curve_card(curve))
    assert "and 4988 more" in reader.words


def test_a_ball_of_many_edges() -> None:
    random = np.random.default_rng(5)
    points = random.normal(size=(400, 3))
    body = fo.Body.convex(points / np.linalg.norm(points, axis=1)[:, None], name="ball")
    assert "ball" in read(body).words


@pytest.mark.parametrize("end", [1.0 + 1e-9, 1e9])
def test_boxes_of_any_width(end: float) -> None:
    read(replace(probe_problem().curve, box=((1.0, end), (1.0, end))))


@pytest.mark.parametrize(
    ("value", "text"), [(None, "-"), (math.nan, "-"), (math.inf, "infinite"), (-math.inf, "-infinite"), (0.5, "0.5")]
)
def test_numbers(value: float | None, text: str) -> None:
    assert number(value) == text


@pytest.mark.parametrize(
    ("bound", "text"), [(0.1234567, "0.123456"), (0.07 - 1e-17, "0.07"), (99999.99, "99999.9"), (1e-310, "1e-310")]
)
def test_bounds_are_not_rounded_up(bound: float, text: str) -> None:
    assert floored(bound, 6) == text


def test_long_texts_keep_both_ends() -> None:
    (text,) = read(Card("A" * 500 + "Z" * 500)).text
    assert len(text) < 200
    assert text.startswith("AAAA")
    assert text.endswith("ZZZZ")


def test_equal_results_give_equal_cards() -> None:
    one, two = (fo.solve(probe_problem()) for _ in range(2))
    one, two = replace(one, seconds={}), replace(two, seconds={})
    assert one._repr_html_() == two._repr_html_()
    assert one.problem._repr_html_() == two.problem._repr_html_()
