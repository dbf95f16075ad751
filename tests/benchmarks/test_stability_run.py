"""The machinery of the stability map: planted methods that fail in every way, through real processes."""

from __future__ import annotations

import json
import math
import re
from collections import Counter

import numpy as np
import planted
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from fcdm_opt.errors import InputError
from fcdm_opt.show import PAGE, save
from fcdm_opt_benchmarks.stability import failures, picture, process, table
from fcdm_opt_benchmarks.stability.case import Grade, HardCase
from fcdm_opt_benchmarks.stability.run import MODULES, Result, stability

pytestmark = pytest.mark.slow  # `stability --quick --ours` runs most of it
HERE = ("planted",)
ALL = len([1 for case in planted.cases(False, 0) for name in planted.METHODS if planted.applies(name, case)])


@pytest.fixture(scope="module")
def short():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process, "GRACE", 1.0)
        yield


@pytest.fixture(scope="module")
def told():
    return []


@pytest.fixture(scope="module")
def results(short, told):
    return stability(False, 0, jobs=4, limit=1.0, progress=lambda *own: told.append(own), modules=HERE)


@pytest.fixture(scope="module")
def saved(results, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    return {(json.loads(path.read_text())["method"], path): path for path in failures.save(results, out)}


def of(results, method):
    return {result.case.name: result for result in results if result.method == method}


def file_of(saved, method):
    return next(path for (name, path) in saved if name == method)


# ------------------------------------------------------------------------------------------------------------ outcomes


def test_every_case_and_method_has_one_result_in_order(results, told):
    names = [(own.case.family, own.case.name, own.method) for own in results]
    assert len(names) == len(set(names)) == ALL
    assert names == [
        (case.family, case.name, method)
        for case in planted.cases(False, 0)
        for method in planted.METHODS
        if planted.applies(method, case)
    ]
    assert max(told) == (ALL, ALL)
    assert {own.method for own in results if own.ours} == set(planted.OURS)


@pytest.mark.parametrize(
    ("method", "outcome", "reason"),
    [
        ("right", "right", ""),
        ("prints", "right", ""),
        ("poisoned", "right", ""),
        ("off: by little", "right", ""),
        ("leaves", "crashed", "exit code 3"),
        ("aborts", "crashed", "SIGABRT: what(): planted"),
        ("greedy", "crashed", "MemoryError"),
        ("raises", "flagged", "ValueError: singular matrix"),
        ("doubts", "flagged", "ill-conditioned"),
        ("unspeakable", "flagged", "of a kind that cannot be sent: object"),
        ("nan", "wrong", "not a number"),
        ("off, by little", "wrong", ""),
        ("rambles", "wrong", "not an answer: KeyError: 'twice'"),
        (
            "unwell",
            "not run",
            "not installed: No module named 'a_library_that_nobody_has': pip install a_library_that_nobody_has",
        ),
    ],
)
def test_each_planted_method_gets_its_outcome(results, method, outcome, reason):
    own = of(results, method)
    assert {result.outcome for result in own.values()} == {outcome}
    assert all(reason in result.reason for result in own.values())


def test_a_method_that_hangs_at_some_cases_answers_the_others(results):
    own = of(results, "hangs")
    assert {name: result.outcome for name, result in own.items()} == {
        "twice 1.0": "hung", "twice 0.1": "hung", "twice 1e-300": "hung", "twice 5.0": "right"
    }  # fmt: skip
    assert own["twice 1.0"].reason == "no answer within 2 s"  # cold
    assert all(result.seconds >= 0.9 for result in own.values() if result.outcome == "hung")


def test_a_process_that_had_no_processor_is_given_half_the_limit_more(results):
    own = of(results, "waits")
    assert {result.outcome for result in own.values()} == {"right"}
    assert own["twice 1.0"].seconds > 2.0  # the limit of a cold process here


def test_answers_and_errors_are_kept(results):
    assert of(results, "right")["twice 0.1"].answer == {"twice": 0.2}
    assert of(results, "off, by little")["twice 5.0"].verdict.error == pytest.approx(1e-5)
    assert math.isnan(of(results, "nan")["twice 5.0"].answer["twice"])
    assert of(results, "hangs")["twice 1.0"].answer is None


def test_what_the_time_does_not_suffice_for_is_said(short):
    """Ours are asked all the same: on a slow machine what they are wrong at would be missed."""
    results = stability(True, 0, jobs=1, limit=1.0, budget=0.0, modules=HERE)
    assert len(results) == 2 * len(planted.METHODS)
    assert {own.outcome for own in results if own.ours} == {"right", "flagged"}
    others = {(own.outcome, own.reason) for own in results if not own.ours}
    assert others == {("not run", "the time in all, 0 s, was used up")}
    assert "| doubling | right | 2 | the time in all, 0 s, was used up |" in table.not_run(results)
    assert "not run 1/1" in table.grid_table(picture.grids(results)[0])


def test_ours_alone_are_asked_all_cases(short):
    results = stability(True, 0, jobs=1, limit=1.0, ours=True, modules=HERE)
    assert {own.method for own in results} == set(planted.OURS)
    assert {own.case.name for own in results} == {case.name for case in planted.cases(True, 0)}


def test_rows_are_plain(results):
    rows = json.loads(json.dumps([own.row for own in results], allow_nan=False))
    assert Counter(row["outcome"] for row in rows) == Counter(own.outcome for own in results)
    assert set(rows[0]) == {
        "question", "family", "name", "method", "ours", "outcome", "error", "reason", "seconds"
    }  # fmt: skip


# ------------------------------------------------------------------------------------------------------------ failures


def test_all_that_is_not_right_is_saved_under_safe_names(results, saved):
    assert len(saved) == sum(own.outcome not in ("right", "not run") for own in results)
    for path in saved.values():
        assert re.fullmatch(r"[a-z0-9-]+\.json", path.name)
        assert path.parent.name == "failures"
    folder = file_of(saved, "nan").parent
    (folder / "mine.json").write_text("{}")
    failures.save([own for own in results if own.method == "nan"], folder.parent)
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        ["mine.json", *(path.name for (name, path) in saved if name == "nan")]
    )
    failures.save(results, folder.parent)


def test_names_of_files_tell_cases_apart_that_read_alike():
    def named(name, method="a"):
        case = HardCase("family", name, "body", {}, {})
        return failures.file_name(Result(case, "m", method, False, Grade("wrong")))

    names = [named(text) for text in ("1e-6", "1e+6", "1e 6", "x" * 300, "x" * 301)] + [named("1e-6", "A")]
    assert len({name.lower() for name in names}) == len(names)
    assert all(len(name) < 130 for name in names)
    assert named("1e-6") == names[0]


def test_numbers_read_back_to_the_last_digit(saved):
    own = failures._read(file_of(saved, "nan"), HERE)
    assert math.isnan(own.answer["twice"])
    assert own.verdict == Grade("wrong", None, "not a number")
    assert own.case in planted.cases(False, 0)
    values = {"x": [math.inf, -math.inf, 0.1 + 0.2, 5e-324, -0.0, {"y": None}]}
    assert failures._decoded(json.loads(json.dumps(failures._encoded(values), allow_nan=False))) == values


def test_a_failure_asked_again_shows_input_truth_and_both_answers(short, saved):
    again = failures.replay(file_of(saved, "off, by little"), limit=5.0, modules=HERE)
    assert again.now.row | {"seconds": 0} == again.then.row | {"seconds": 0}
    for text in ("  x: 1.0", "  twice: 2.0", "then: wrong, relative error 1e-05", "now: wrong", '{"twice": 2.00002}'):
        assert text in again.text
    assert "now: crashed: SIGABRT: what(): planted" in failures.replay(file_of(saved, "aborts"), modules=HERE).text


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"module": "os"}, "unknown module"),
        ({"method": "right?"}, "unknown method"),
        ({"case": {"family": "x"}}, "not a saved failure"),
        ({"verdict": None}, "not a saved failure"),
    ],
)
def test_other_files_are_refused(saved, tmp_path, change, what):
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(json.loads(file_of(saved, "doubts").read_text()) | change))
    with pytest.raises(InputError, match=what):
        failures.replay(path, modules=HERE)
    path.write_text("[")
    with pytest.raises(InputError, match="not JSON"):
        failures.replay(path, modules=HERE)
    with pytest.raises(InputError, match=r"gone\.json: cannot be read"):
        failures.replay(tmp_path / "gone.json")


def test_saved_failures_of_the_tests_are_no_modules_of_the_toolkit(saved):
    assert "planted" not in MODULES
    with pytest.raises(InputError, match="unknown module"):
        failures.replay(file_of(saved, "doubts"))


# -------------------------------------------------------------------------------------------------- picture and tables


def test_the_picture_shows_every_outcome(results, tmp_path):
    figure = picture.stability_figure(results, title="Map", caption="Of planted methods.")
    large, vector, small, dark = save(figure, tmp_path / "map", small=True)
    for file, width in ((large, int(300 * PAGE)), (small, 1000)):
        image = imread(file)
        assert image.shape[1] == width
        for outcome, look in picture.LOOKS.items():
            if look.fill == "#FFFFFF":
                continue
            share = (np.abs(image[:, :, :3] - to_rgb(look.fill)).max(axis=2) < 0.01).mean()
            assert share > 1e-3, outcome
    assert imread(dark)[:, :, :3].mean() < 0.5  # for a dark page
    text = vector.read_text()
    for word in ("off, by little", "first", "second", "w 1/1", "h 3/3", "Of planted methods."):
        assert f">{word}<" in text


def test_cells_show_the_worst_and_columns_start_with_ours():
    def result(method, family, outcome, ours=False):
        return Result(HardCase(family, "x", "body", {}, {}), "m", method, ours, Grade(outcome))

    own = [
        result("b 1", "f", "right"),
        result("a", "f", "hung"),
        result("b, 2", "f", "right"),
        result("b 1", "f", "wrong"),
        result("a", "f", "right"),
        result("mine", "f", "flagged", True),
        result("a", "g", "right"),
    ]
    (grid,) = picture.grids(own)
    assert grid.methods == ("mine", "b 1", "b, 2", "a")
    assert grid.ours == 1
    rows = table.grid_table(grid).splitlines()
    assert rows[2:] == ["| f | flagged 1/1 | wrong 1/2 | 1 | hung 1/2 |", "| g |  |  |  | 1 |"]


def test_tables_list_ours_with_reasons_and_others_with_an_example(results, saved, tmp_path):
    path = table.write_tables(results, tmp_path / "stability.md", about="About.")
    ours, others, missing = path.read_text().split("\n## ")[2:]
    assert ours.count("| flagged | doubts |") == 2
    assert "ill-conditioned" in ours
    assert "raises" not in ours
    assert "| hangs | first | hung | 3 |" in others
    name = file_of(saved, "leaves").name
    assert f"(failures/{name})" in others
    assert "| doubling | unwell | 2 | not installed" in missing
