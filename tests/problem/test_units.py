"""The unit that a problem file names: shown wherever a length is, and of no influence on any number."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import fcdm_opt as fo
from fcdm_opt.design.compensation.table import MapPoints
from fcdm_opt.design.question import Question
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.show import tables, texts
from fcdm_opt.show.maps import map_figure, yield_figure
from fcdm_opt.show.plots import family_figure
from fcdm_opt.show.printing import print_head
from fcdm_opt.show.report.cases import answered
from fcdm_opt.show.report.gather import gather
from fcdm_opt.show.report.page import page, study_page
from fcdm_opt.show.scene import ShownBodies, scene_figure
from fcdm_opt.show.sensitivities import sensitivities_figure
from fcdm_opt.show.solved import SolvedCase, solved_case
from fcdm_opt.show.studies import study_figure

PROBLEMS = Path(__file__).parents[2] / "problems"
CORNERS = [[x, y, z] for x in (0, 2) for y in (0, 2) for z in (0, 2)]
BASE = [[x, y, z] for x in (-1, 3) for y in (-1, 3) for z in (-1, 0)]
OFF = "OFF\n4 4 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
CASE = '[[case]]\nname = "P"\ntolerance = 0.02\nrequirement = "A"\ngoal = "touch"\nmotion = [{ translation = "z" }]\n'
LINE = "lengths in mm, angles in degrees\n"


def load(folder: Path, movable: str = "", static: str = "", more: str = "") -> fo.Problem:
    """Return the problem of a file whose bodies have vertices, with further lines in their tables."""
    path = folder / "boxes.toml"
    bodies = f"[bodies.movable]\nvertices = {CORNERS}\n{movable}\n[bodies.static]\nvertices = {BASE}\n{static}\n"
    path.write_text(f"{bodies}{more}\n{CASE}", encoding="utf-8")
    (made,) = fo.load_problems(path)
    return made


@cache
def boxes(unit: str) -> fo.Problem:
    """A box on a plate, both made 2 % too large: it must go up."""
    bodies = fo.Body.convex(CORNERS, name="box"), fo.Body.convex(BASE, name="plate")
    up = fo.Translation("z")
    return fo.Problem(*bodies, tolerance=0.02, requirement="A", goal="touch", motion=up, name="P", unit=unit)


@cache
def example(unit: str) -> fo.Problem:
    return fo.load_problems(PROBLEMS / "example1.toml")[1].changed(unit=unit)


@cache
def solved(unit: str) -> SolvedCase:
    return solved_case(boxes(unit), certify=True)


@cache
def mapped(unit: str) -> Any:
    return fo.compensation_map(boxes(unit), box=((0.98, 1.02), (0.98, 1.02)), error=1e-2)


@cache
def shared(unit: str) -> Any:
    sizes = (fo.Uniform(0.98, 1.02), fo.Uniform(0.98, 1.02))
    return fo.assembly_yield(mapped(unit), sizes=sizes, budget=0.03, count=1000)


@cache
def studied(unit: str, folder: Path) -> Any:
    study = fo.Study(boxes(unit), {"tolerance": [0.01, 0.02, 0.03]}, budget=0.03)
    return fo.run_study(study, folder / f"study-{unit}", jobs=1)


def words(text: str) -> list[str]:
    """Return where "mm" stands as a word, with what is before it."""
    return re.findall(r"\S+ \(?mm\b", text)


# ----------------------------------------------------------------------------------------------------- where it is from


@pytest.mark.parametrize(
    ("movable", "static", "more", "unit"),
    [
        ("", "", "", ""),
        ('unit = "mm"', 'unit = "mm"', "", "mm"),
        ("", 'unit = "in"', "", "in"),
        ("", "", '[[keep_out]]\nname = "rib"\nfile = "rib.off"\nunit = "um"', "um"),
    ],
)
def test_unit_is_the_one_that_bodies_name(tmp_path: Path, movable: str, static: str, more: str, unit: str) -> None:
    (tmp_path / "rib.off").write_text(OFF)
    made = load(tmp_path, movable, static, more)
    assert made.unit == unit
    path = tmp_path / "boxes.toml"
    assert [question.problem().unit for question in Question.read(path)] == [unit]
    other = tmp_path / "other.toml"
    other.write_text(f'bodies = "boxes.toml"\n{CASE}')
    assert fo.load_problems(other)[0].unit == ("" if more else unit)  # keep-outs are not taken from there
    assert made.movable.vertices.tolist() == CORNERS  # the numbers stay as they are


def test_meshes_are_converted_to_it_as_before(tmp_path: Path) -> None:
    (tmp_path / "wedge.off").write_text(OFF)
    text = '[bodies.movable]\nfile = "wedge.off"\nunit = "mm"\nfile_unit = "in"\n[bodies.static]\nfile = "wedge.off"\n'
    path = tmp_path / "wedges.toml"
    path.write_text(f'{text}unit = "mm"\n{CASE}')
    (made,) = fo.load_problems(path)
    assert made.unit == "mm"
    assert (made.movable.vertices == 25.4 * made.static.vertices).all()
    (question,) = Question.read(path)
    again = question.changed({"bodies.static.vertices": BASE}).problem()
    assert again.unit == "mm"
    assert again.static.vertices.tolist() == BASE


def test_different_units_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"different units.*STEP and GLB files say what they are in") as caught:
        load(tmp_path, 'unit = "mm"', 'unit = "in"')
    assert "bodies.static in in, bodies.movable in mm" in str(caught.value)
    data = boxes("mm").to_dict()
    data["bodies"]["static"]["unit"] = "cm"
    with pytest.raises(InputError, match="different units"):
        fo.Problem.from_dict(data)
    question = Question.of(boxes("mm")).changed({"bodies.static.unit": "cm"})
    with pytest.raises(InputError, match="different units"):
        question.problem()


@pytest.mark.parametrize("unit", ["furlong", "MM", 1, None])
def test_unknown_units_are_refused(unit: Any) -> None:
    with pytest.raises(InputError, match=r"unknown unit|unit: an unusable value"):
        boxes("").changed(unit=unit)


# ----------------------------------------------------------------------------------------------- kept, and of no effect


def test_unit_is_kept() -> None:
    problem = boxes("mm")
    kept = [
        problem.changed(tolerance=0.01),
        problem.changed(goal="clear", clearance=0.1),
        fo.Problem.from_dict(problem.to_dict()),
        Question.of(problem).problem(),
        Question.restored(Question.of(problem).scene.text, Question.of(problem).case).problem(),
        fo.whatif(solved("mm").solution, tolerance=0.01).after.problem,
    ]
    assert [own.unit for own in kept] == ["mm"] * len(kept)
    assert fo.Problem.from_dict(problem.to_dict()).to_dict() == problem.to_dict()


def test_solution_of_before_there_were_units_loads() -> None:
    old = solved("").solution.to_dict()
    assert "unit" not in str(old["problem"])
    assert fo.Solution.from_dict(old).problem.unit == ""
    assert fo.Solution.from_dict(solved("mm").solution.to_dict()).problem.unit == "mm"


def test_no_number_follows_from_it(tmp_path: Path) -> None:
    one, two = solved("").solution, solved("mm").solution
    assert one.amount > 0
    assert (one.parameters, one.amount, one.lower_bound) == (two.parameters, two.amount, two.lower_bound)
    assert Question.of(boxes("")).scene.key == Question.of(boxes("mm")).scene.key
    first, second = studied("", tmp_path), studied("mm", tmp_path)
    assert first.study == second.study  # what is worked out in one unit is known in all
    assert [key for key, _ in first.points] == [key for key, _ in second.points]
    in_inches = Question.of(boxes("in")).scene.text
    assert in_inches != Question.of(boxes("mm")).scene.text  # but each worker knows its own


# --------------------------------------------------------------------------------------------------------------- shown


def _solutions(unit: str) -> None:
    print_head("boxes.toml", "Boxes", "", unit=unit)
    tables.print_solutions([solved(unit)])


def _ranges(unit: str) -> None:
    found = fo.coherent_range(example(unit), {"TZ": 1.0})
    print_head("e.toml", "", "", unit=unit)
    tables.print_ranges([(found, fo.contact_times(example(unit), {"TZ": 1.0}))])


def _curves(unit: str) -> None:
    print_head("boxes.toml", "", "", unit=unit)
    tables.print_curves({boxes(unit).curve: ["P"]})


def _whatif(unit: str) -> None:
    tables.print_case("boxes.toml", boxes(unit))
    tables.print_whatif(fo.whatif(solved(unit).solution, tolerance=0.01))


@pytest.mark.parametrize("printed", [_solutions, _curves, _whatif])
def test_tables_say_it_once(printed: Callable[[str], None], capsys: pytest.CaptureFixture[str]) -> None:
    printed("")
    bare = re.sub(r"time of .*", "", capsys.readouterr().out)
    printed("mm")
    text = re.sub(r"time of .*", "", capsys.readouterr().out).replace(LINE, "", 1)
    # verdicts above the table and remarks below are sentences: each length has its unit
    text = re.sub(r"(?s)^.*(?=case  asked)|unmoved, over .*", lambda found: found[0].replace(" mm", ""), text)
    assert text == bare
    assert not words(bare)


def test_ranges_say_it(capsys: pytest.CaptureFixture[str]) -> None:
    _ranges("mm")
    text = capsys.readouterr().out
    assert LINE in text
    assert "along TZ, face 3" in text
    _ranges("")
    assert not words(capsys.readouterr().out)


def test_words_say_it() -> None:
    assert example("mm").motion.describe([0.25, math.pi], unit="mm") == "TZ 0.25 mm + RZ 180 deg"
    screw = fo.Screw(((0, 0, 0), (0, 0, 1)), pitch="free")
    assert screw.describe([0.5, math.pi], unit="in") == "Screw 0.5 in, 180 deg"
    assert texts.motion_text(solved("mm").solution).endswith(" mm")
    assert solved("mm").solution.to_dict()["motion"].endswith(" mm")
    assert solved("").solution.to_dict()["motion"] == solved("mm").solution.to_dict()["motion"].removesuffix(" mm")


@pytest.mark.slow
def test_report_says_it(tmp_path: Path) -> None:
    load(tmp_path, 'unit = "mm"')
    path = tmp_path / "boxes.toml"

    class File:
        title = note = ""
        error = None
        problems = ProblemFile.read(path).problems(fo.Problem, path)

    File.path = path
    payload = gather([File()], certify=True, frames=0.0)
    html = re.sub(r"<script.*?</script>|<style.*?</style>|<!--.*?-->", "", page(payload), flags=re.DOTALL)
    amount = f"{payload['cases'][0]['amount']:.4g}"
    for text in (
        *(f"<dd>TZ {amount} mm</dd>", f"<dd>{amount} mm<", f">TZ {amount} mm<", f"<td>{amount} mm</td>"),
        *("lengths in mm", ">amount, mm<", "<td>mm</td>"),
    ):
        assert text in html, text
    assert payload["cases"][0]["unit"] == "mm"
    assert all(frame["motion"].endswith(" mm") for frame in payload["cases"][0]["families"]["motion"]["frames"])
    nameless = {role: replace(getattr(File.problems[0], role), unit="") for role in ("movable", "static")}
    File.problems = tuple(problem.changed(unit="", **nameless) for problem in File.problems)
    bare = page(gather([File()], certify=True, frames=0.0))
    assert not words(re.sub(r"<script.*?</script>|<style.*?</style>|<!--.*?-->", "", bare, flags=re.DOTALL))


def _texts(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.findobj(Text))


PICTURES: dict[str, tuple[Callable[[str, Path], Figure], str]] = {
    "scene": (lambda unit, _: scene_figure(ShownBodies.of(boxes(unit).movable, boxes(unit).static), unit=unit), "1 mm"),
    "sensitivities": (lambda unit, _: sensitivities_figure(solved(unit).solution), "amount (mm)"),
    "family": (lambda unit, _: family_figure(fo.coherent_range(example(unit), {"TZ": 1.0})), "TZ 1 mm"),
    "map": (lambda unit, _: map_figure(mapped(unit)), "motion (mm)"),
    "yield": (lambda unit, _: yield_figure(shared(unit)), "motion (mm)"),
    "study": (lambda unit, folder: study_figure(studied(unit, folder)), "amount (mm)"),
}


@pytest.mark.sampled(3)
@pytest.mark.usefixtures("coarse_maps")
@pytest.mark.parametrize("name", PICTURES)
def test_pictures_say_it(name: str, tmp_path: Path) -> None:
    draw, told = PICTURES[name]
    text = _texts(draw("mm", tmp_path))
    assert told in text
    assert "length unit" not in text
    bare = _texts(draw("", tmp_path))
    assert not words(bare)
    assert "length unit" in bare or name == "family"


def test_study_says_it(tmp_path: Path) -> None:
    found = studied("mm", tmp_path)
    assert found.unit == "mm"
    assert "amount, mm: 0." in str(found)
    assert "amount: 0." in str(studied("", tmp_path))
    assert "Amounts (mm)" in study_page(found)
    mixed = fo.Study([boxes("mm"), boxes("in").changed(name="Q")], {"tolerance": [0.01]})
    assert mixed.unit == ""


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_cards_say_it(tmp_path: Path) -> None:
    made: dict[str, Callable[[str], Any]] = {
        "problem": lambda unit: boxes(unit).changed(goal="clear", clearance=0.5),
        "solution": lambda unit: solved(unit).solution,
        "what if": lambda unit: fo.whatif(solved(unit).solution, tolerance=0.01),
        "range": lambda unit: fo.coherent_range(example(unit), {"TZ": 1.0}),
        "map": mapped,
        "yield": shared,
        "clearances": lambda unit: fo.clearances(boxes(unit), count=100),
        "best pose": lambda unit: fo.best_pose(boxes(unit)),
        "study": lambda unit: studied(unit, tmp_path),
    }
    for name, make in made.items():
        card = re.sub(r"<[^>]*>", " ", make("mm")._repr_html_())
        assert words(re.sub(r"\s+", " ", card)), name
        assert " length" not in card, name
        assert not words(re.sub(r"<[^>]*>", " ", make("")._repr_html_())), name
    assert fo.clearances(boxes("mm"), count=100).unit == fo.best_pose(boxes("mm")).unit == "mm"


def test_amounts_of_ones_own_have_no_unit() -> None:
    import casadi

    own = boxes("mm").changed(amount=2.0 * casadi.SX.sym("TZ") ** 2)
    assert (own.unit, own.amount_unit) == ("mm", "")
    assert boxes("mm").amount_unit == "mm"


def test_a_bound_in_a_report_had_its_unit_twice() -> None:
    """Proved at least "0 mm mm": the page adds the unit to the number."""
    assert answered(replace(solved("mm").solution, lower_bound=0.0))["least"]["text"] == "0"


def test_rounding_is_told_as_0_and_never_as_minus_0() -> None:
    """A map told "amount -1.13e-15", and parts were "-0 apart"; data have what was worked out."""
    noise = np.array([-1.13e-15])
    none = {"error": np.zeros(1), "displacement_error": np.zeros(1), "region": np.zeros(1, int)}
    found = MapPoints(parameters=noise[:, None], amount=noise, names=("TX",), **none)
    assert str(found) == "TX 0, amount 0 +- 0, region 0"
    assert found.amount[0] == noise[0]
    assert [measured(x, "mm") for x in (-0.0, -1.13e-15, -2e-6)] == ["0 mm", "0 mm", "-2e-06 mm"]
    assert [texts.number(x) for x in (-0.0, 3e-13, math.nan)] == ["0", "0", "-"]
    assert [texts.amount_text(x, "mm") for x in (-1.13e-15, 0.25)] == ["0 mm", "0.25 mm"]
    assert [signed(x) for x in (-0.0, -1e-16, -0.5)] == ["+0", "+0", "-0.5"]
