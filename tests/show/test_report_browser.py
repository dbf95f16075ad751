"""The report in a real browser: figures follow sliders, keys and colour scheme; legible on a phone and on paper."""

from __future__ import annotations

import os
import re
import shutil
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from study_results import TAUS, result

import fcdm_opt as fo
from fcdm_opt.design.study.point import row
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show.rendering import rendered
from fcdm_opt.show.report.page import assembly_page, assembly_report, study_page

CHROMIUM = shutil.which("chromium")
PROBLEMS = Path(__file__).parents[2] / "problems"
CASES = ("A", "B")
HOSTILE = "</script><b>bold"
PATIENCE, AGAIN = 180.0, 0.05  # seconds: for what nothing announces, and until it is looked for again
DRAWN = 1e-6  # of what plotly hands back: WebGL keeps single precision
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Text lines of different elements that share pixels, by the rectangles of what is drawn.
OVERLAPS = """() => {
  const boxes = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode, parent = node.parentElement;
    if (!node.data.trim() || parent.closest("script, style, noscript, select, .skip, #bodies")) continue;
    if (parent.closest("details:not([open])") && !parent.closest("summary")) continue;
    const clip = parent.closest(".scroll")?.getBoundingClientRect();
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) {
      if (r.width < 2 || r.height < 2 || (clip && (r.right > clip.right || r.left < clip.left))) continue;
      boxes.push([r.left, r.top, r.right, r.bottom, node.data.trim().slice(0, 30)]);
    }
  }
  boxes.sort((a, b) => a[1] - b[1]);
  const found = [];
  for (let i = 0; i < boxes.length; i++) {
    for (let j = i + 1; j < boxes.length && boxes[j][1] < boxes[i][3]; j++) {
      const [a, b] = [boxes[i], boxes[j]];
      const wide = Math.min(a[2], b[2]) - Math.max(a[0], b[0]), high = Math.min(a[3], b[3]) - Math.max(a[1], b[1]);
      if (wide > 2 && high > 0.25 * Math.min(a[3] - a[1], b[3] - b[1])) found.push(`${a[4]} | ${b[4]}`);
    }
  }
  return found;
}"""
# Elements that reach beyond the page's right edge, but for those in a box that scrolls.
CUT_OFF = """() => [...document.querySelectorAll("main *, header *")]
  .filter(e => !e.closest(".scroll, .plot, svg > *, noscript, details:not([open]) > :not(summary)"))
  .filter(e => e.getClientRects().length)
  .filter(e => e.getBoundingClientRect().right > document.documentElement.clientWidth + 1)
  .map(e => `${e.tagName}.${e.className}`)"""
# Boxes whose contents have to be scrolled sideways.
WIDER = """() => [...document.querySelectorAll(".scroll, .matrix")]
  .filter(e => e.getClientRects().length && e.scrollWidth > e.clientWidth + 1).map(e => e.innerText)"""
TRACE = """([plot, name]) => {
  const t = document.getElementById(plot).data.find(t => t.name === name);
  return t && { x: [...t.x], y: [...t.y], z: t.z ? [...t.z] : [] };
}"""

pytestmark = [
    pytest.mark.skipif(
        CHROMIUM is None, reason="the browser is Debian's package chromium, which is not installed here"
    ),
    pytest.mark.skipif(
        os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"), reason="the report's cases need compiled kernels"
    ),
]


@dataclass(frozen=True)
class Read:
    """A problem file as the command line reads it."""

    path: Path
    title: str
    note: str
    problems: tuple[Problem, ...]
    error: str | None = None


@pytest.fixture(scope="module")
def payload():
    from fcdm_opt.show.report.gather import gather

    path = PROBLEMS / "example1.toml"
    file = ProblemFile.read(path)
    problems = tuple(problem for problem in file.problems(Problem, path) if problem.name in CASES)
    data = gather([Read(path, file.title, file.note, problems)], certify=False, frames=0.0)
    data["cases"][1]["bodies"][0]["name"] = HOSTILE
    data["cases"][1]["scene"]["objects"][0]["name"] = HOSTILE
    return data


@pytest.fixture(scope="module")
def address(payload, tmp_path_factory):
    from fcdm_opt.show.report.page import page

    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(page(payload), encoding="utf-8")
    return path.as_uri()


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as engine:
        started = engine.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


class Opened:
    """A page that is open, with all that went wrong in it."""

    def __init__(self, browser, address, **options):
        self.wrong = []
        self.context = browser.new_context(offline=True, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(180_000)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", lambda said: self.wrong.append(said.text) if said.type == "error" else None)
        self.page.on("request", self._asked)
        self.page.goto(address)
        self.page.wait_for_selector("html[data-ready]", state="attached")

    def _asked(self, request):
        if not request.url.startswith(("file:", "data:", "blob:")):
            self.wrong.append(request.url)

    def text(self, name):
        return self.page.text_content(f"#{name}")

    def drawn(self, what):
        """Wait until the figures show a case, and a pose or a family and place."""
        self.page.wait_for_selector(f'html[data-drawn="{what}"]', state="attached")

    def until(self, expression, value):
        """Wait until an expression has a value; the page's own policy forbids playwright to wait inside it."""
        end = time.monotonic() + PATIENCE
        while self.page.evaluate(expression) != value and time.monotonic() < end:
            time.sleep(AGAIN)
        assert self.page.evaluate(expression) == value

    def trace(self, plot, name):
        return self.page.evaluate(TRACE, [plot, name])

    def camera(self):
        return self.page.evaluate("() => document.getElementById('bodies').layout.scene")

    def slide(self, place):
        self.page.evaluate(
            "k => { const s = document.getElementById('slider'); s.value = k; s.dispatchEvent(new Event('input')); }",
            place,
        )


@pytest.fixture(scope="module")
def desk(browser, address):
    """One page for all that is tried with a mouse and keys on a wide screen."""
    opened = Opened(browser, address, viewport={"width": 1280, "height": 900})
    yield opened
    opened.context.close()


@pytest.fixture
def wide(desk):
    """The page on a wide screen as it is after loading: first case, corrected pose."""
    desk.page.select_option("#choose", "0")
    desk.drawn("0 corrected")
    yield desk
    assert desk.wrong == []


def points(trace):
    columns = [column for column in (trace["x"], trace["y"], trace["z"]) if column]
    return np.array([[np.nan if x is None else x for x in column] for column in columns], dtype=float).T


def placed(case, body, frame):
    """Where a frame puts the corners of a body, worked out apart from the page's own code."""
    solid = case["scene"]["objects"][body]
    seed = np.array(solid["seed"])
    corners = seed + frame["sizes"][body] * (np.array(solid["points"]) - seed)
    if body == 0 and frame["transform"]:
        transform = np.reshape(frame["transform"], (4, 4))
        corners = corners @ transform[:3, :3].T + transform[:3, 3]
    return corners


def shows(opened, case, frame):
    """Check scene, curve and numbers against a frame."""
    for body, role in enumerate(("movable", "static")):
        corners = placed(case, body, frame)
        np.testing.assert_allclose(points(opened.trace("bodies", role)), corners, atol=DRAWN * np.abs(corners).max())
    if frame["transform"]:
        line = points(opened.trace("curve", "after"))
        for x1, y1, x2, y2, *_ in frame["curve"]:
            for end in ((x1, y1), (x2, y2)):
                assert np.nanmin(np.hypot(*(line - end).T)) <= DRAWN
        np.testing.assert_allclose(points(opened.trace("curve", "tracked point after"))[0], frame["rho"], rtol=DRAWN)
    np.testing.assert_allclose(points(opened.trace("curve", "parts made"))[0], frame["target"], rtol=DRAWN)
    assert opened.text("now-motion") == frame["motion"]
    assert float(opened.text("now-amount")) == pytest.approx(frame["amount"], rel=1e-3)
    assert opened.text("now-state") == frame["pair_state"]
    assert float(opened.text("now-gap")) == pytest.approx(frame["pair_gap"], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("pose", ["nominal", "rescaled", "corrected", "tracked"])
def test_poses_change_scene_curve_and_numbers(wide, payload, pose):
    case = payload["cases"][0]
    wide.page.check(f"input[name=pose][value={pose}]", force=True)
    wide.drawn(f"0 {pose}")
    shows(wide, case, case["poses"][pose])


@pytest.mark.sampled(1)
@pytest.mark.parametrize("family", ["tolerance", "motion"])
def test_sliders_change_scene_curve_and_numbers(wide, payload, family):
    case = payload["cases"][0]
    frames = case["families"][family]["frames"]
    wide.page.check(f"input[name=family][value={family}]", force=True)
    for place in (0, len(frames) - 1):
        wide.slide(place)
        wide.drawn(f"0 {family} {place}")
        assert wide.text("slider-value") == case["families"][family]["shown"][place]
        shows(wide, case, frames[place])
    assert wide.page.locator("input[name=pose]:checked").count() == 0
    assert len({str(frame["curve"]) for frame in frames}) > 1  # else this shows nothing


def test_fast_sliding_ends_where_the_slider_stands(wide, payload):
    frames = payload["cases"][0]["families"]["tolerance"]["frames"]
    for place in (*range(len(frames)), 1):
        wide.slide(place)
    wide.drawn("0 tolerance 1")
    shows(wide, payload["cases"][0], frames[1])


def test_slider_and_cases_by_keyboard(wide, payload):
    start = payload["cases"][0]["families"]["tolerance"]["start"]
    wide.page.focus("#slider")
    wide.page.keyboard.press("ArrowRight")
    wide.drawn(f"0 tolerance {start + 1}")
    assert wide.page.get_attribute("#slider", "aria-valuetext") == wide.text("slider-value") != ""
    wide.page.focus('a[href="#case-1"]')
    wide.page.keyboard.press("Enter")
    wide.drawn("1 corrected")
    assert wide.page.is_visible('.answer[data-case="1"]')
    assert not wide.page.is_visible('.answer[data-case="0"]')
    assert wide.page.evaluate("document.activeElement.getAttribute('href')") == "#case-1"
    shows(wide, payload["cases"][1], payload["cases"][1]["poses"]["corrected"])


def test_skipping_to_the_answer_keeps_the_case(wide):
    wide.page.select_option("#choose", "1")
    wide.drawn("1 corrected")
    wide.page.focus(".skip")
    wide.page.keyboard.press("Enter")
    wide.until("location.hash", "#answers")
    wide.page.evaluate("new Promise(requestAnimationFrame)")
    assert wide.page.input_value("#choose") == "1"


def test_scene_by_keyboard(wide):
    first = wide.camera()
    wide.page.focus("#bodies")

    def pressed(key):
        wide.page.keyboard.press(key)
        scene = wide.camera()
        centre, eye = (np.array(list(scene["camera"][k].values())) for k in ("center", "eye"))
        return eye - centre, scene["aspectratio"]["x"], centre

    arm = np.subtract(*(list(first["camera"][k].values()) for k in ("eye", "center")))
    for there, back in (("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown")):
        turned = pressed(there)[0]
        assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(arm))
        assert np.arccos(turned @ arm / (arm @ arm)) > 0.1
        np.testing.assert_allclose(pressed(back)[0], arm, atol=1e-9)
    size = first["aspectratio"]["x"]
    assert pressed("+")[1] > size
    assert pressed("-")[1] == pytest.approx(size)
    assert pressed("c")[1] > size
    normal = pressed("n")[0]
    assert abs(normal @ arm) / np.linalg.norm(normal) / np.linalg.norm(arm) < 0.99
    reset = pressed("0")
    np.testing.assert_allclose(reset[0], arm, atol=1e-9)
    assert reset[1] == pytest.approx(size)


def test_view_stays_while_the_slider_moves(wide, payload):
    wide.page.focus("#bodies")
    wide.page.keyboard.press("ArrowLeft")
    before = wide.camera()["camera"]
    wide.slide(0)
    wide.drawn("0 tolerance 0")
    assert wide.camera()["camera"] == before


def test_zoom_of_the_curve(wide, payload):
    axes = payload["cases"][0]["axes"]
    for zoom in ("box", "window"):
        wide.page.click(f"[data-zoom={zoom}]")
        wide.until("['x', 'y'].map(k => document.getElementById('curve').layout[`${k}axis`].range)", axes[zoom])


def test_sizes_of_an_assembly_that_is_impossible_were_cut_off_and_its_sheet_spilled(browser, tmp_path):
    """A block under a lid on two walls, .1 too high with .05 of room: the one table there is has the whole width."""
    walls = {name: fo.Box((2, 20, 10), centre=(x, 0, 5)) for name, x in (("left", -9), ("right", 9))}
    parts = {"base": fo.Box((40, 40, 2), centre=(0, 0, -1)), **walls}
    parts |= {"block": fo.Box((8, 8, 9.95), centre=(0, 0, 4.975)), "lid": fo.Box((20, 20, 2), centre=(0, 0, 11))}
    between = [("block", "base"), ("lid", "left"), {"parts": ("lid", "block"), "goal": "clear"}]
    height = fo.Size("height of the block", "block", faces=["-z", "+z"], each=0.5, tolerance=0.03)
    motions = dict.fromkeys(("block", "lid"), fo.Translation("z"))
    asked = fo.Assembly(parts, between, [height], motions, unit="mm", made={"height of the block": 0.15})
    solutions = [fo.solve(own) for own in (asked.changed(made={}), asked)]
    assert [own.status.found for own in solutions] == [True, False]
    file = {"file": "block.toml", "title": "Block", "note": "", "sha256": None, "cases": [0, 1]}
    (tmp_path / "report.html").write_text(assembly_page([file], [*map(assembly_report, solutions)]), encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 1280, "height": 900})
    assert "beyond the tolerance" in opened.page.inner_text("#case-1")
    assert opened.page.evaluate(WIDER) == []
    assert opened.page.inner_text(".card >> nth=0").startswith("Stack-up of the gap of lid and block, at rest")
    sheets = re.findall(rb"/Type\s*/Page[^s]", opened.page.pdf(format="A4", prefer_css_page_size=True))
    assert len(sheets) == 3  # a case each, and what belongs to all
    opened.context.close()


def test_the_report_of_an_assembly_had_no_scene_to_turn(browser, tmp_path):
    """A key 2 % too large between two wedges: each part where its motion takes it, and what touches on the slopes."""
    path = PROBLEMS / "assemblies" / "loop_of_four.toml"
    asked = next(each for each in fo.load_assemblies(path) if each.scales["key"] == 1.02)
    solution = fo.solve(asked)
    text = assembly_page(
        [{"file": path.name, "title": "", "note": "", "sha256": None, "cases": [0]}], [assembly_report(solution)]
    )
    assert "relative to left wedge, which carries it" in text
    assert text.count('<table class="title-block">') == text.count('<section class="sheet">') + 1  # of the case
    (tmp_path / "report.html").write_text(text, encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 900, "height": 900})
    opened.drawn("0 corrected")
    assert "contact point" in opened.page.inner_text("#viewer .key")  # black circles were not explained
    solids = opened.page.evaluate(
        "document.getElementById('bodies').data.filter(t => t.type === 'mesh3d' && t.name !== 'contact area')"
        ".map(t => ({ x: [...t.x], y: [...t.y], z: [...t.z] }))"
    )
    for part, solid in zip(asked.parts, solids, strict=True):
        seed, pose = asked.parts[part].seed, np.asarray(solution.transforms.get(part, np.eye(4)))
        corners = seed + asked.scales[part] * (asked.parts[part].vertices - seed)
        expected = corners @ pose[:3, :3].T + pose[:3, 3]
        found = points(solid)
        assert max(np.linalg.norm(found - corner, axis=1).min() for corner in expected) < 1e-5
    shift = solution.parameters["left wedge"]["TX"]
    camera = opened.camera()["camera"]
    arm = np.subtract(*(list(camera[k].values()) for k in ("eye", "center")))
    nearer = arm / np.linalg.norm(arm)  # rings stand before what is beside them
    shown = points(opened.trace("bodies", "contact"))
    places = shown - shown[0, 2] / nearer[2] * nearer
    assert (np.abs(places[:2, 2]) < 1e-5).all()  # both wedges stand on the base, z = 0
    assert places[2, 2] == pytest.approx(-(places[2, 0] - shift) - 1.0, abs=1e-5)  # on the left one's slope
    opened.page.click("[data-look=cut]")
    opened.until("document.getElementById('bodies').data.some(t => t.name === 'contact, cut')", True)
    rings, ranges = points(opened.trace("bodies", "contact")), [opened.camera()[f"{k}axis"]["range"] for k in "xyz"]
    assert ((rings - np.mean(ranges, axis=1)) / np.ptp(ranges, axis=1) < 0.5).all()  # beyond they are not drawn
    opened.page.check("input[name=pose][value=rescaled]", force=True)
    opened.drawn("0 rescaled")
    assert opened.trace("bodies", "before the motion") is None
    assert opened.wrong == []
    opened.context.close()


def test_the_contact_is_seen_where_the_parts_are_cut_open(wide, payload):
    """It was inside, whichever way one turned: no corner is left before the section through it."""
    case = payload["cases"][0]
    frame, facing = case["poses"]["corrected"], np.array(case["scene"]["section"])
    level = (np.array(frame["contacts"] or case["poses"]["tracked"]["contacts"]) @ facing)[0]
    count = "document.getElementById('bodies').data.find(t => t.name === '{}').x.length"
    whole = [len(solid["points"]) for solid in case["scene"]["objects"]]
    wide.page.click("[data-look=cut]")
    wide.until(f"{count.format('movable')} !== {whole[0]} || {count.format('static')} !== {whole[1]}", True)
    find = "document.getElementById('bodies').data.find(t => t.name === role)"
    used = f"role => {{ const {{ i, j, k }} = {find}; return [...i, ...j, ...k]; }}"
    heights = [
        points(wide.trace("bodies", role))[wide.page.evaluate(used, role)] @ facing - level
        for role in ("movable", "static")
    ]
    size = case["scene"]["size"]
    assert min(own.max() for own in heights) < 1e-3 * size  # one that is wholly before it stays
    wide.page.click("[data-look=clear]")
    for corners, role in zip(whole, ("movable", "static"), strict=True):
        wide.until(count.format(role), corners)


def test_points_that_were_cut_away_floated_before_the_section(browser, tmp_path):
    """A plate .5 above three tips, cut open through the first: of those before the section no mark is left."""
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    feet = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)]
    tips = fo.Body.from_parts(
        [np.array([*((x + dx, y + dy, -2.0) for dx, dy in feet), (x, y, 0.0)]) for x, y in ((0, 6), (5, 0), (-5, -6))],
        name="tips",
    )
    asked = {"motion": fo.Translation("z"), "goal": "touch", "target": (1, 1), "name": "down"}
    problem = fo.Problem(fo.Box((16, 20, 2), centre=(0, 0, 1.5), name="plate"), tips, **asked)
    data = gather([Read(PROBLEMS / "example1.toml", "", "", (problem,))], certify=False, frames=0.0)
    (case,) = data["cases"]
    heights = np.array(case["poses"]["corrected"]["contacts"]) @ np.array(case["scene"]["section"])
    (tmp_path / "report.html").write_text(page(data), encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 900, "height": 900})
    opened.drawn("0 corrected")
    count = (
        "document.getElementById('bodies').data.filter(t => t.name.startsWith('feature') && t.mode === 'markers')"
        ".reduce((sum, t) => sum + t.x.length, 0)"
    )
    opened.page.click("[data-look=clear]")
    opened.until(count, 3)
    opened.page.click("[data-look=cut]")
    behind = [height <= heights[0] + 1e-6 for height in heights]
    assert sum(behind) < 3
    opened.until(count, sum(behind))
    opened.context.close()


@pytest.mark.slow
def test_sizes_without_a_curve_had_an_empty_chart_and_a_phone_named_columns_by_others(browser, tmp_path):
    """Pins of 9.9 in bores of 12 do not go in 2.5 farther apart; no scale near that drawn makes them touch."""
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    pins = [fo.Cylinder(4.95, 16, base=(x, 0, -10)) for x in (-20, 20)]
    base = fo.joined(fo.Box((60, 40, 8), centre=(0, 0, -9), name="base"), *pins)
    plate = fo.cut(fo.Box((60, 40, 8), name="plate"), *(fo.Cylinder(6, 30, base=(x, 0, -15)) for x in (-20, 20)))
    size = fo.Size("spacing", "static", faces=["cylinder radius 4.95 no. 2"], along="x", tolerance=3.0)
    asked = {"sizes": [size], "goal": "clear", "motion": fo.Translation("x"), "limits": {"TX": (-0.5, 0.5)}}
    problems = tuple(fo.Problem(plate, base, made={"spacing": x}, name=f"{x}", **asked) for x in (2.5, 2.6))
    data = gather([Read(PROBLEMS / "example1.toml", "", "", problems)], certify=False, frames=0.0)
    assert [case["amount"] for case in data["cases"]] == [None, None]
    (tmp_path / "report.html").write_text(page(data), encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 390, "height": 844})
    opened.drawn("0 rescaled")
    assert opened.text("viewer-title") == "Contact"
    assert not opened.page.is_visible("#curve")
    cells = "e => [...e.querySelectorAll('td')].map(x => [getComputedStyle(x, '::before').content, x.innerText])"
    row = dict(opened.page.eval_on_selector(".all tbody tr", cells))
    assert row.pop('"verified"').endswith("no motion")
    assert row.pop('"motion"') == "does not fit"
    assert set(row) == {'"asked for"', '"amount"', '"pair made"'}
    assert opened.page.is_visible(".all tbody td:nth-child(4)") is False
    words = opened.page.inner_text("body")
    for empty in ("What touches", "Bounds and their evidence", "best first over separating"):
        assert empty not in words
    assert opened.wrong == []
    opened.context.close()


@pytest.mark.slow
def test_a_report_on_sizes_had_a_curve_of_scales_and_no_stack_up_on_paper(browser, tmp_path):
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    path = PROBLEMS / "slot_and_key.toml"
    file = ProblemFile.read(path)
    problems = [own for own in file.problems(Problem, path) if own.name != "as drawn"]
    problems[0] = problems[0].changed(name="a_name_of_a_case_that_no_line_may_break_as_it_has_no_blank", goal="clear")
    data = gather([Read(path, file.title, file.note, tuple(problems))], certify=False, frames=0.0)
    for case in data["cases"]:  # the axis of the chart lay on a table with such a column
        del case["stack"]["shares"][4:]  # of more sizes there is no chart
        case["stack"]["shares"][0]["coefficient"] = "-0.966 to +0.966"
    (tmp_path / "report.html").write_text(page(data), encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 390, "height": 844})
    opened.page.wait_for_selector("html[data-drawn]", state="attached")
    assert not opened.page.is_visible("#chart")
    assert opened.page.evaluate(CUT_OFF) == []
    assert opened.page.evaluate(WIDER) == []
    assert opened.page.is_visible("#choose")
    opened.page.set_viewport_size({"width": 1280, "height": 900})
    assert not opened.page.is_visible("#choose")  # the list of cases is there
    with on_paper(opened, "sheets") as pages:
        assert [pages(size) for size in ("A4", "Letter")] == [len(problems) + 1] * 2  # that of the stack-up of all
        assert "64.5 %" in opened.page.locator(".card .stack").inner_text()
        opened.page.set_viewport_size({"width": 718, "height": 1040})  # A4
        table, chart = (opened.page.locator(f".card .stack {own}").bounding_box() for own in ("table", "figure svg"))
        assert table["x"] + table["width"] <= chart["x"]
        for number in range(len(problems)):
            sheet = opened.page.locator(f'.answer[data-case="{number}"]').inner_text()
            assert "+0.0325 mm" in sheet
    assert opened.wrong == []
    opened.context.close()


@pytest.mark.slow
def test_a_tall_box_and_its_lid_fill_the_frame_and_are_cut_open_across_the_rim(browser, tmp_path):
    """They ran out of the frame, and the plane lay in the front wall: the room within stayed shut."""
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    def block(*ends):
        return np.array([[ends[k][bit >> k & 1] for k in range(3)] for bit in range(8)], dtype=float)

    walls = [((-10, -8), (-6, 6)), ((8, 10), (-6, 6)), ((-8, 8), (-6, -4)), ((-8, 8), (4, 6))]
    base = fo.Body.from_parts(
        [block(*sides, (0, 60)) for sides in walls] + [block((-10, 10), (-6, 6), (-2, 0))], name="box"
    )
    lid = fo.Body.convex(block((-10, 10), (-6, 6), (60, 63)), name="lid")
    asked = fo.Problem(lid, base, goal="seat", target=(1.0, 1.02), motion=fo.Translation("z"))
    path = PROBLEMS / "example1.toml"
    case = (data := gather([Read(path, "", "", (asked,))], certify=False, frames=0.0))["cases"][0]
    (tmp_path / "report.html").write_text(page(data), encoding="utf-8")
    for width in (1280, 390):
        opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": width, "height": 900})
        opened.drawn("0 corrected")
        scene, frame = opened.camera(), opened.page.locator("#bodies").bounding_box()
        eye, centre, up = (np.array(list(scene["camera"][k].values())) for k in ("eye", "center", "up"))
        right = np.cross(up, eye - centre)
        page_axes = np.array([right, np.cross(eye - centre, right)])
        page_axes /= np.linalg.norm(page_axes, axis=1)[:, None]
        ranges = [scene[f"{k}axis"]["range"] for k in "xyz"]
        unit = scene["aspectratio"]["x"] / np.ptp(ranges[0])
        corners = np.vstack([placed(case, body, case["poses"]["corrected"]) for body in (0, 1)])
        shown = ((corners - np.mean(ranges, axis=1)) * unit - centre) @ page_axes.T
        room = np.array([frame["width"] / frame["height"], 1.0])  # of an orthographic view, two units high
        assert 0.7 < (np.abs(shown) / room).max() < 1.0
        opened.page.click("[data-look=cut]")
        opened.until("document.getElementById('bodies').data.find(t => t.name === 'movable').x.length !== 8", True)
        facing, size = np.array(case["scene"]["section"]), case["scene"]["size"]
        kept = points(opened.trace("bodies", "static edges")) @ facing
        middle = float(np.mean([placed(case, 1, case["poses"]["corrected"]) @ facing]))
        assert np.nanmax(kept) == pytest.approx(middle, abs=1e-3 * size)  # through the middle of box and lid
        assert opened.wrong == []
        opened.context.close()


def test_words_and_picture_of_an_answer_stand_side_by_side(wide):
    said, drawn = (wide.page.locator(f".answer.chosen .{name}").bounding_box() for name in ("said", "drawn-picture"))
    assert drawn["x"] >= said["x"] + said["width"]
    assert abs(drawn["y"] - said["y"]) < 2.0
    assert drawn["width"] > 0.9 * said["width"]


def test_pointer_names_feature_and_line(wide, payload):
    trace = wide.page.evaluate("() => document.getElementById('curve').data.find(t => t.name === 'before').text")
    labels = {payload["cases"][0]["labels"][segment[4]] for segment in payload["cases"][0]["poses"]["nominal"]["curve"]}
    for label in labels:
        assert any(label in text and "\u03c1<sub>1</sub>" in text and "=" in text for text in trace)


def test_hostile_names_are_text(wide):
    wide.page.select_option("#choose", "1")
    wide.drawn("1 corrected")
    assert wide.text("key-movable") == HOSTILE
    assert HOSTILE in wide.page.inner_text('.answer[data-case="1"]')
    said = wide.page.evaluate("() => document.getElementById('bodies').data.find(t => t.name === 'movable').text[0]")
    assert said.startswith("&lt;/script&gt;&lt;b&gt;bold")


def test_ids_stay_unique_with_figures(wide):
    ids = wide.page.evaluate("() => [...document.querySelectorAll('[id]')].map(e => e.id)")
    assert len(ids) == len(set(ids)) > 20


def test_wide_screen_is_legible(wide):
    assert wide.page.evaluate(OVERLAPS) == []
    assert wide.page.evaluate(CUT_OFF) == []


def test_planted_overlap_and_cut_are_seen(wide):
    move = "margin => { document.querySelector('.answer.chosen .big').style.margin = margin; }"
    for margin, check in (("-30px 0 0", OVERLAPS), ("0 0 0 4000px", CUT_OFF)):
        wide.page.evaluate(move, margin)
        assert wide.page.evaluate(check) != []
        wide.page.evaluate(move, "")


@contextmanager
def on_paper(opened, wanted, **options):
    """Show a page as it is printed, with what is wanted chosen at its head."""
    opened.page.select_option("#print", wanted)
    opened.page.emulate_media(media="print", **options)
    opened.page.wait_for_selector("html.printing", state="attached")
    yield lambda size: len(re.findall(rb"/Type\s*/Page[^s]", opened.page.pdf(format=size, prefer_css_page_size=True)))
    opened.page.emulate_media(media="screen", color_scheme="light")
    opened.page.wait_for_selector("html:not(.printing)", state="attached")
    opened.page.select_option("#print", "sheets")


def test_a_shop_gets_a_sheet_a_case_with_room_to_sign(wide, payload):
    """Figures were cut, headings stood alone, half of the pages were blank."""
    with on_paper(wide, "sheets") as pages:
        assert [pages(size) for size in ("A4", "Letter")] == [len(CASES)] * 2
        for number, case in enumerate(payload["cases"]):
            sheet = wide.page.locator(f'.answer[data-case="{number}"]')
            for told in ("Revision", "Approved", case["motion"], *case["extents"][0][1:3]):
                assert told in sheet.inner_text()
            assert sheet.locator(".drawn-picture").bounding_box()["height"] > 200
        for hidden in ("#slider", "button >> nth=0", "#choose", "#details", "#chooser"):
            assert not wide.page.is_visible(hidden)


@pytest.mark.slow
def test_a_sheet_of_many_sizes_spilled_its_title_block_on_a_second_and_had_letters_of_four_points(browser, tmp_path):
    """A drawer in a housing, six sizes with the stack-up of all: where it is closed, and where nothing fits."""
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    housing = fo.cut(fo.Box((40, 70, 20), centre=(0, 25, 6)), fo.Box((30.2, 60, 12.15), centre=(0, 30, 6.075)))
    drawer = fo.Box((30, 60, 10), centre=(0, 30, 5), name="drawer")
    flanks = [({"through": (-x, 20, 5)}, {"through": (x, 20, 5)}) for x in (15, 15.1)]
    sizes = [
        fo.Size("drawer width", "movable", faces=flanks[0], each=0.5, tolerance=(-0.052, 0)),
        fo.Size("cavity width", "static", faces=flanks[1], each=-0.5, tolerance=(0, 0.052)),
        fo.Size("cavity place", "static", faces=flanks[1], along="x", tolerance=0.03),
        fo.Size("drawer height", "movable", faces={"through": (14, 20, 10)}, tolerance=(-0.043, 0)),
        fo.Size("cavity height", "static", faces={"through": (0, 20, 12.15)}, each=-1, tolerance=(0, 0.07)),
        fo.Size("stop", "static", faces={"through": (0, 0, 5)}, tolerance=0.1),
    ]
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    asked = fo.Problem(drawer, housing, sizes=sizes, motion=motion, goal="seat", contacts="all", unit="mm")
    short = asked.changed(name="stop short", made={"stop": 0.08, "drawer height": -0.02})
    wide = asked.changed(name="too wide", goal="clear", contacts=None, made={"stop": 0.08, "drawer width": 0.3})
    (tmp_path / "report.html").write_text(page(gather([Read(tmp_path, "", "", (short, wide))])), "utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 718, "height": 1040})  # A4
    with on_paper(opened, "sheets") as pages:
        assert opened.page.evaluate(OVERLAPS) == []
        assert [pages(size) for size in ("A4", "Letter")] == [3, 3]  # the last is of the stack-up of both
        letters = opened.page.evaluate(
            "[...document.querySelectorAll('.answer svg text')].filter(t => t.getClientRects().length)"
            ".map(t => parseFloat(getComputedStyle(t).fontSize)"
            " * Math.hypot(t.getScreenCTM().a, t.getScreenCTM().b))"
        )
        assert len(letters) > 6
        assert min(letters) >= 0.98 * 7 * 96 / 72  # seven points
    opened.context.close()


@pytest.mark.slow
def test_of_three_contacts_two_were_cut_open_and_more_stand_clear_of_words_on_paper(browser, tmp_path):
    """A block in a corner, .4, .1 and .01 larger: three cuts on screen, on a phone and on paper."""
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    walls = [(80, 70, 15, 0, 5, -7.5), (20, 70, 30, -30, 5, 15), (80, 20, 30, 20, 30, 15)]
    room = fo.Body.from_parts([fo.Box(own[:3], centre=own[3:]).vertices for own in walls], name="corner")
    block = fo.Box((50, 40, 25), centre=(5, 0, 12.5), name="block")
    sizes = [fo.Size(axis, "movable", faces=[f"+{axis}", f"-{axis}"], each=[0.5, 0.5], tolerance=1) for axis in "xyz"]
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    asked = fo.Problem(block, room, sizes=sizes, made={"x": 0.4, "y": 0.1, "z": 0.01}, motion=motion, unit="mm")
    changes = ("longer", {"made": {"x": 0.4}}), ("wide", {"goal": "clear", "clearance": 0.3})
    each = (asked, *(asked.changed(name=name, **change) for name, change in changes))
    data = gather([Read(tmp_path, "", "", each)], certify=False, frames=0.0)
    assert len(data["cases"][0]["picture"]["insets"]) == 3
    (tmp_path / "report.html").write_text(page(data), "utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 1280, "height": 900})
    for width in (1280, 390):
        opened.page.set_viewport_size({"width": width, "height": 900})
        assert opened.page.evaluate(OVERLAPS) == []
        assert opened.page.evaluate(CUT_OFF) == []
    opened.page.set_viewport_size({"width": 718, "height": 1040})
    with on_paper(opened, "sheets") as pages:
        assert opened.page.evaluate(OVERLAPS) == []
        assert [pages(size) for size in ("A4", "Letter")] == [4, 4]
        assert "Of cases" in opened.page.inner_text(".sheet .stack")
        table, chart = (opened.page.locator(f".sheet .pair {own}").bounding_box() for own in ("table", "figure"))
        assert table["x"] + table["width"] <= chart["x"]
        assert "Approved" in opened.page.inner_text(".sheet")
        scene, picture = (opened.page.locator(f".answer.chosen {own}").bounding_box() for own in (".scene", "figure"))
        assert scene["height"] > 0.7 * picture["height"]  # it was as narrow as two insets in a row left it
    assert opened.wrong == []
    opened.context.close()


@pytest.mark.slow
def test_what_is_drawn_how_lay_on_the_answer_of_four_contacts_on_paper(browser, tmp_path):
    """A cover on a block on a base, and a stop that follows the block: four cuts, and captions within the sheet."""
    parts = {
        "base with a pocket": fo.cut(
            fo.Box((80, 40, 30), centre=(0, 0, 5)), fo.Box((60, 40, 20.1), centre=(0, 0, 10.05))
        ),
        "hardened block": fo.Box((20, 20, 12), centre=(0, 0, 6)),
        "cover that is screwed on": fo.Box((30, 30, 4), centre=(0, 0, 14)),
        "stop of the block": fo.Box((10, 10, 6), centre=(15, 0, 3)),
    }
    between = [
        ("hardened block", "base with a pocket"),
        ("cover that is screwed on", "hardened block"),
        ("stop of the block", "base with a pocket"),
        ("stop of the block", "hardened block"),
    ]
    sizes = [
        fo.Size("height", "hardened block", faces="+z", tolerance=0.1),
        fo.Size("width", "hardened block", faces="+x", tolerance=0.1),
    ]
    motions = {
        "hardened block": fo.Translation("z"),
        "cover that is screwed on": fo.Translation("z"),
        "stop of the block": fo.Translation("x"),
    }
    asked = fo.Assembly(parts, between, sizes, motions, unit="mm", made={"height": 0.1, "width": 0.1}, name="large")
    case = assembly_report(fo.solve(asked))
    assert len(case["picture"]["insets"]) == 4
    file = {"file": "four.toml", "title": "four", "note": "", "sha256": "0" * 64, "cases": [0]}
    (tmp_path / "report.html").write_text(assembly_page([file], [case]), "utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 1280, "height": 900})
    for width in (1280, 800, 390):
        opened.page.set_viewport_size({"width": width, "height": 900})
        assert opened.page.evaluate(OVERLAPS) == []
        assert opened.page.evaluate(CUT_OFF) == []
    corner = "all => all.map(e => e.getBoundingClientRect()).map(box => [box.left, box.top, box.right])"
    two, _, four = opened.page.locator(".insets svg").evaluate_all(corner)[1:]  # two a row on a phone, all across it
    assert two[1] == opened.page.locator(".insets svg").first.bounding_box()["y"]
    assert min(two[2], four[2]) > 0.9 * 390
    opened.page.set_viewport_size({"width": 1280, "height": 900})
    scene, insets, motions = opened.page.locator(".told table, .answer .scene, .insets").evaluate_all(corner)
    assert motions[2] < scene[0]  # what moves stands next to the picture
    assert motions[1] < insets[1]
    for size, width, height in (("A4", 718, 1040), ("Letter", 740, 980)):
        opened.page.set_viewport_size({"width": width, "height": height})
        with on_paper(opened, "sheets") as pages:
            assert opened.page.evaluate(OVERLAPS) == []
            assert pages(size) == 1 + any("worst" in own for own in case["stacks"])
            captions = opened.page.locator(".insets text").evaluate_all(
                "all => all.map(e => e.getBoundingClientRect())"
            )
            assert min(own["left"] for own in captions) >= 0.0
            assert max(own["right"] for own in captions) <= width
            shown = opened.page.locator(".insets svg").evaluate_all("all => all.map(e => getComputedStyle(e).overflow)")
            assert set(shown) == {"visible"}
    assert opened.wrong == []
    opened.context.close()


def test_paper_shows_the_details_of_the_chosen_case_where_they_are_wanted(wide):
    with on_paper(wide, "case") as pages:
        assert [wide.page.is_visible(f"#case-{number}") for number in range(len(CASES))] == [True, False]
        assert pages("A4") <= 4


def test_paper_shows_all_cases_and_tables_in_light_colours(wide, payload):
    with on_paper(wide, "all", color_scheme="dark"):
        for number in range(len(payload["cases"])):
            assert wide.page.is_visible(f'.answer[data-case="{number}"]')
            assert wide.page.is_visible(f"#case-{number} >> text=Checks of the judge")
        assert not wide.page.is_visible("text=Relative tolerances and their reasons")  # folded away: no answer
        assert not wide.page.is_visible("#slider")
        assert wide.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        wide.until("document.getElementById('curve').layout.font.color", "#16191d")
        assert wide.page.evaluate(OVERLAPS) == []
    assert not wide.page.is_visible("text=Relative tolerances and their reasons")


def test_a_long_key_stood_on_the_headline_on_paper(browser, tmp_path):
    from fcdm_opt.show.report.gather import gather
    from fcdm_opt.show.report.page import page

    file = ProblemFile.read(path := PROBLEMS / "nut.toml")
    asked = tuple(own for own in file.problems(Problem, path) if own.name == "turned until it holds")
    (tmp_path / "report.html").write_text(page(gather([Read(path, "", "", asked)], certify=False, frames=0.0)), "utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 718, "height": 1000})  # A4
    with on_paper(opened, "sheets") as pages:
        assert len(opened.page.query_selector_all(".answer .key li")) > 9
        assert opened.page.evaluate(OVERLAPS) == []
        assert [pages(size) for size in ("A4", "Letter")] == [1, 1]
    opened.context.close()


def test_a_grid_of_eleven_columns_was_cut_off_on_a_screen_of_900_pixels(browser, tmp_path):
    values = [f"{x:+.2f} mm" if x else "as drawn" for x in np.linspace(-0.3, 0.3, 11).round(2)]
    grid = {
        "name": "TX",
        "unit": "mm",
        "columns": values,
        "rows": values,
        "cells": [["-0.14"] * 11] * 11,
        "between": "",
    }
    words = dict.fromkeys(("off", "open", "jumps", "bounded", "off_between", "still", "reached", "unit"), "")
    words |= {"title": "hasp", "down": "window spacing of faces F12, F14", "across": "staple spacing of faces F11, F13"}
    (tmp_path / "grid.html").write_text(rendered("grid.html", grids=[grid], moved="hasp", **words), encoding="utf-8")
    page = browser.new_page(viewport={"width": 900, "height": 700})
    page.goto((tmp_path / "grid.html").as_uri())
    assert page.locator("tbody tr").count() == 11
    assert page.evaluate(WIDER) == []
    page.close()


def test_figures_follow_the_dark_scheme(wide):
    for scheme, ink in (("dark", "#e9eaec"), ("light", "#16191d")):
        wide.page.emulate_media(color_scheme=scheme)
        wide.until("document.getElementById('curve').layout.font.color", ink)
        wide.until("document.getElementById('bodies').layout.font.color", ink)
        ground = "getComputedStyle(document.querySelector('.answer.chosen .drawn-picture')).backgroundColor"
        assert wide.page.evaluate(ground) == "rgba(0, 0, 0, 0)"  # a white plate stood under it
        assert wide.page.evaluate(OVERLAPS) == []


def test_a_phone_had_the_verdicts_on_all_cases_below_the_answer(browser, tmp_path):
    """A block 5.9 and 6 high on a base: two lines a case, whether it is verified beside its name."""
    parts = {"base": fo.Box((40, 20, 10), centre=(0, 0, -5)), "block": fo.Box((8, 8, 6), centre=(0, 0, 3))}
    height = fo.Size("height", "block", faces="-z", tolerance=0.2)
    asked = fo.Assembly(parts, [("block", "base")], [height], {"block": fo.Translation("z")}, unit="mm", name="drawn")
    cases = [fo.solve(own) for own in (asked, asked.changed(made={"height": -0.1}, name="low"))]
    file = {"file": "a.toml", "title": "Block", "note": "", "sha256": None, "cases": [0, 1]}
    (tmp_path / "report.html").write_text(assembly_page([file], [*map(assembly_report, cases)]), encoding="utf-8")
    opened = Opened(browser, (tmp_path / "report.html").as_uri(), viewport={"width": 390, "height": 844})
    opened.drawn("0 corrected")
    assert opened.page.evaluate(CUT_OFF) == []
    boxes = """s => [...document.querySelectorAll(s)].filter(e => e.getClientRects().length)
        .map(e => e.getBoundingClientRect().toJSON())"""
    names, verdicts, answers = (
        opened.page.evaluate(boxes, chosen) for chosen in (".all tbody a", ".all td:last-child", ".answer")
    )
    assert len(answers) == 1
    assert max(own["bottom"] for own in verdicts) < min(answers[0]["top"], 844)
    assert [own["top"] == pytest.approx(other["top"], abs=4) for own, other in zip(names, verdicts, strict=True)] == [
        True
    ] * 2
    opened.page.click(".all a >> nth=1")
    opened.drawn("1 corrected")
    assert opened.page.inner_text(".answer.chosen h2") == "Case low"
    assert "Move block 0.1 mm along -z:" in opened.page.inner_text(".answer.chosen .big")
    opened.context.close()


def test_phone_in_the_dark_without_webgl(browser, address):
    options = {"viewport": {"width": 390, "height": 844}, "color_scheme": "dark", "is_mobile": True}
    opened = Opened(browser, address, **options)
    assert opened.page.evaluate("document.documentElement.scrollWidth") == 390
    all_cases, answer = (opened.page.locator(name).bounding_box() for name in ("#chooser", ".answer.chosen"))
    assert answer["y"] + answer["height"] <= all_cases["y"]  # these filled the first screen, before any answer
    assert opened.page.evaluate(CUT_OFF) == []
    assert opened.page.evaluate(OVERLAPS) == []
    opened.page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    opened.page.reload()
    opened.page.wait_for_selector("html[data-ready]", state="attached")
    assert opened.page.is_visible("#scene-missing")
    assert opened.trace("curve", "before")
    assert opened.wrong == []
    opened.context.close()


def test_readable_without_scripts(browser, address):
    context = browser.new_context(offline=True, java_script_enabled=False)
    page = context.new_page()
    page.goto(address)
    for number in range(len(CASES)):
        assert page.is_visible(f'.answer[data-case="{number}"]')
        assert page.is_visible(f"#case-{number}")
    assert page.is_visible("noscript")
    context.close()


@pytest.mark.slow
def test_a_study_of_words_without_a_motion_is_drawn_too(browser, tmp_path):
    made = result(["A", HOSTILE])
    made.answers.clear()
    made.answers.update({key: row(key, "INFEASIBLE", "Proved impossible") for key, _ in made.points})
    made.answers[made.points[0][0]] = row(made.points[0][0], "ERROR", "KeyError: 'rim'")
    path = tmp_path / "study.html"
    path.write_text(study_page(made), encoding="utf-8")
    opened = Opened(browser, path.as_uri())
    try:
        symbols = opened.page.evaluate("document.getElementById('chart').data.flatMap(t => [t.marker.symbol].flat())")
        assert symbols.count("cross-thin-open") == 1  # it failed: of no other point a motion is known not to be there
        assert "no usable motion" in opened.text("key")
        assert "without an answer" in opened.text("key")
        opened.page.select_option("#x-axis", "case")
        opened.drawn("case|amount|case|0")
        opened.slide(5)
        opened.drawn("case|amount|case|5")
        chosen = opened.trace("chart", "chosen point")
        assert chosen["x"] == [HOSTILE.replace("<", "&lt;").replace(">", "&gt;")]
        assert 0.0 < chosen["y"][0] < 0.1  # of the height: it has no amount
        assert opened.wrong == []
    finally:
        opened.context.close()


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"viewport": {"width": 390, "height": 844}, "color_scheme": "dark"}])
def test_a_study_is_walked_through_point_by_point(browser, options, tmp_path):
    path = tmp_path / "study.html"
    made = result(["A", HOSTILE], budget=11.5)
    path.write_text(study_page(made), encoding="utf-8")
    names = "case", "tolerance  (relative; 0.01 = 1 %)", f"amount ({made.unit or 'length units'})"
    opened = Opened(browser, path.as_uri(), **options)
    try:
        opened.drawn("tolerance|amount|case|0")
        for place, case, tau, amount in ((5, HOSTILE, 0.02, "12"), (7, HOSTILE, 0.04, "\u2013"), (2, "A", 0.03, "3")):
            opened.slide(place)
            opened.drawn(f"tolerance|amount|case|{place}")
            told = opened.page.evaluate(
                "() => [...document.querySelectorAll('#now div')].map(own => [...own.children].map(e => e.textContent))"
            )
            assert dict(told) | dict(zip(names, (case, str(tau), amount), strict=True)) == dict(told)
        chosen = opened.trace("chart", "chosen point")
        assert (chosen["x"], chosen["y"]) == ([0.03], [3.0])
        drawn = opened.trace("chart", "case: A")
        assert (drawn["x"], drawn["y"]) == (TAUS, [1.0, 2.0, 3.0, 4.0])
        opened.page.focus("#slider")
        opened.page.keyboard.press("ArrowRight")
        opened.drawn("tolerance|amount|case|3")
        opened.page.select_option("#y-axis", "TZ")
        opened.drawn("tolerance|TZ|case|3")
        assert opened.trace("chart", "case: A")["y"] == [-1.0, -2.0, -3.0, -4.0]
        assert opened.page.evaluate(OVERLAPS) == []
        assert opened.page.evaluate(CUT_OFF) == []
        assert opened.wrong == []
    finally:
        opened.context.close()


@pytest.mark.slow
def test_twice_the_tolerance_left_the_picture(wide, payload):
    """The slider's last place: the box and all marks are inside the part of the curve that is shown."""
    last = len(payload["cases"][0]["families"]["tolerance"]["values"]) - 1
    wide.page.check("input[name=family][value=tolerance]", force=True)
    wide.slide(last)
    wide.drawn(f"0 tolerance {last}")
    seen = wide.page.evaluate(
        """() => {
          const { layout, data } = document.getElementById("curve");
          const box = layout.shapes.find(shape => shape.name === "tolerance box");
          const marks = data.filter(trace => /parts made|tracked point/.test(trace.name));
          const along = k => [box[`${k}0`], box[`${k}1`], ...marks.flatMap(trace => [...trace[k]])];
          return ["x", "y"].map(k => [layout[`${k}axis`].range, along(k)]);
        }"""
    )
    for (low, high), values in seen:
        assert len(values) == 5
        assert all(low < value < high for value in values)
