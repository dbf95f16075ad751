"""`fcdm-opt bench` and `fcdm-opt stability` with what nobody meant to give them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fcdm_opt.cli import app
from fcdm_opt.cli.guarding import BAD_INPUT
from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks import contacts as contact_methods
from fcdm_opt_benchmarks import motions, record
from fcdm_opt_benchmarks.chart import bench, results
from fcdm_opt_benchmarks.comparing import compared
from fcdm_opt_benchmarks.method import ContactAnswer, Method, one_by_one, read_methods
from fcdm_opt_benchmarks.record import BenchRun, Load
from fcdm_opt_benchmarks.stability import contacts, failures, worker
from fcdm_opt_benchmarks.stability.case import HardCase
from fcdm_opt_benchmarks.timing import TimedScene, TimingPlan

ROW = {"task": "contact", "scene": "a", "method": "m", "outcome": "answered", "seconds": 1.0, "low": 0.9, "high": 1.1}
FAILURE: dict[str, Any] = {
    "case": {"family": "f", "name": "n", "question": "contact", "data": {}, "truth": {}},
    "module": contacts.__name__,
    "method": "exact path",
    "answer": None,
    "verdict": {"outcome": "wrong", "error": 0.5, "reason": ""},
    "seconds": 1.0,
}
NO_JSON = {"empty": "", "cut": '{"schema": 1, "tables": {', "deep": "[" * 100_000, "long": '{"a": ' + "9" * 5000 + "}"}


def run(command: str = "bench", **row: Any) -> BenchRun:
    return BenchRun(command, True, 1, {}, "2026-01-01", 1.0, Load(None, None), {"chart": [{**ROW, **row}]}, {}, {})


def refused(*words: str) -> str:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == BAD_INPUT, result.output
    return result.output


@pytest.fixture
def nothing_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    def measured(**given: Any) -> BenchRun:
        raise AssertionError("measured what cannot be compared or written")

    monkeypatch.setattr(bench, "bench", measured)
    monkeypatch.setattr("fcdm_opt_benchmarks.stability.grid.grid", measured)


# ----------------------------------------------------------------------------------------- files of other kinds


@pytest.mark.parametrize("text", NO_JSON.values(), ids=NO_JSON)
@pytest.mark.parametrize("read", [BenchRun.read, failures.replay])
def test_what_is_no_json_is_refused(read: Callable[[Path], Any], text: str, tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"file\.json.*not JSON"):
        read(path)


@pytest.mark.parametrize("value", ["x", [1.0], True, float("inf"), 10**400], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("column", record.NUMBERS)
def test_columns_that_are_compared_are_numbers(column: str, value: Any, tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    run().write(path)
    data = json.loads(path.read_text())
    data["tables"]["chart"][0][column] = value
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=rf"old\.json.*tables\.chart\.{column}: not a number"):
        BenchRun.read(path)


@pytest.mark.parametrize("old", [{"seconds": None}, {"seconds": 0.0, "low": 0.0, "high": 0.0}, {"low": None}])
def test_times_that_were_not_measured_are_not_compared(old: dict[str, Any]) -> None:
    assert not compared(run(**old), run()).changes


def test_what_was_not_measured_again_is_not_gone() -> None:
    old = replace(run(), settings={"parts": ["contact", "growth"]}, tables={"chart": [ROW], "growth": [ROW]})
    new = replace(old, settings={"parts": ["contact"]}, tables={"chart": [], "growth": []})
    found = compared(old, new)
    assert [(change.table, change.new) for change in found.changes] == [("chart", "is gone")]
    assert "contact" in found.notes[-1]


BAD: dict[str, Callable[[dict[str, Any]], Any]] = {
    "case.data": lambda data: data["case"].update(data="text"),
    "case.truth": lambda data: data["case"].update(truth=[1]),
    "case.family": lambda data: data["case"].update(family=3),
    "verdict.error": lambda data: data["verdict"].update(error="much"),
    "method": lambda data: data.update(method=["exact path"]),
    "module": lambda data: data.update(module=None),
    "seconds": lambda data: data.update(seconds="long"),
}


@pytest.mark.parametrize("key", BAD)
def test_an_edited_failure_is_refused_with_the_key(key: str, tmp_path: Path) -> None:
    data = json.loads(json.dumps(FAILURE))
    BAD[key](data)
    path = tmp_path / "failure.json"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=rf"failure\.json: {key}"):
        failures.replay(path)


# ----------------------------------------------------------------------------------------- before a long measurement


@pytest.mark.usefixtures("nothing_measured")
@pytest.mark.parametrize("command", ["bench", "stability"])
def test_what_cannot_be_used_is_said_before_anything_is_measured(command: str, tmp_path: Path) -> None:
    file, old = tmp_path / "a file", tmp_path / "old.json"
    file.write_text("")
    assert "--out" in refused(command, "--out", str(file))
    assert "--out" in refused(command, "--out", str(file / "below"))
    run("bench" if command == "stability" else "stability").write(old)
    assert "another command" in refused(command, "--out", str(tmp_path / "ö ∂"), "--compare", str(old))
    assert "--seed" in refused(command, "--out", str(tmp_path), "--seed", "-1")


# ----------------------------------------------------------------------------------------- methods, libraries, systems


def test_a_library_that_is_missing_is_said_not_dropped() -> None:
    def unhappy(data: Any) -> Any:
        raise ModuleNotFoundError("No module named 'highspy'", name="highspy")

    assert worker._reply(unhappy, {}) == {"missing": "No module named 'highspy': pip install highspy"}
    point = {"vertices": [[0.0, 0.0, 0.0]], "parts": []}
    assert all(contacts.applies(name, HardCase("f", "n", "contact", {"one": point, "two": point}, {}))
               for name in contacts.METHODS)  # fmt: skip


@pytest.mark.parametrize("answer", [None, "text", object()])
def test_an_answer_of_another_kind_fails_alone(answer: Any) -> None:
    odd = Method("odd", "rival", {"x": None}, lambda subject, setting: one_by_one(lambda question: answer))
    scene = TimedScene("s", {"vertices": 8}, None, lambda k: k)
    plan = TimingPlan(1, 1e-6, 1, 1.0)
    worth = lambda scene, k, given: bench.Worth(given.rho2)  # noqa: E731
    task = bench.ChartTask("contact", [odd], [scene], worth, plan, lambda scene: 2)
    (row,) = bench.charted(task, np.random.default_rng(0), [], lambda text: None)
    assert row["outcome"] == "failed"
    assert "not an answer" in row["reason"]


def test_a_system_that_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def unreadable(*given: Any, **named: Any) -> str:
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(Path, "read_text", unreadable)
    monkeypatch.setattr(record.psutil, "cpu_times", unreadable)
    assert record.machine()["cores"]
    assert record.Watch().load().others is None


RIVAL = """
from fcdm_opt_benchmarks.method import ContactAnswer, Method, one_by_one

def prepare(pair, setting):
    return one_by_one(lambda question: ContactAnswer(0.5))

METHODS = {"contact": [Method("half", "mine", {"only": 1.0}, prepare)]}
"""


def test_a_rival_of_a_file_is_added_to_its_chart(tmp_path: Path) -> None:
    path, known = tmp_path / "rival.py", {"contact": contact_methods.METHODS, "motion": motions.METHODS}
    path.write_text(RIVAL)
    (rival,) = read_methods(path, known)["contact"]
    assert rival.prepare(None, 1.0)([None, None]) == [ContactAnswer(0.5)] * 2
    with pytest.raises(InputError, match=r"rival\.py.*unusable method"):
        read_methods(path, {"contact": [rival]})  # its name is taken
    wrong = {"1 / 0": "ZeroDivisionError", "": "no methods", "METHODS = {'shape': []}": "contact, motion"}
    for text, said in wrong.items():
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_methods(path, known)


def test_the_command_takes_rivals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict[str, Any] = {}

    def stopped(**given: Any) -> None:
        asked.update(given)
        raise InputError("enough")

    monkeypatch.setattr(bench, "bench", stopped)
    (tmp_path / "rival.py").write_text(RIVAL)
    line = ["bench", "--quick", "--only", "contact", "--method", str(tmp_path / "rival.py"), "--out", str(tmp_path)]
    assert CliRunner().invoke(app, line).exit_code == 2
    assert [method.name for method in asked["rivals"]["contact"]] == ["half"]
    refused = CliRunner().invoke(app, [*line, "--ours"])
    assert refused.exit_code == 2
    assert "rivals are not asked with --ours" in refused.stderr
    assert CliRunner().invoke(app, ["bench", "--ours", "--out", str(tmp_path)]).exit_code == 2
    assert asked["ours"]


def test_without_rivals_none_is_said_to_be_slower() -> None:
    run = bench.bench(quick=True, only=("contact",), ours=True)
    assert {row["family"] for row in run.tables["chart"]} == {"ours"}
    assert results.summary(run) == "- One contact: no rival was asked."
