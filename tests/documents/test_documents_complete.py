"""The documentation names every status, check, tolerance and exit code that the code has, and none that it has not."""

from __future__ import annotations

import ast
import importlib
import re
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

import fcdm_opt as fo
from fcdm_opt.cli import common
from fcdm_opt.judge import certificate, multipliers
from fcdm_opt.problem.evidence import Reason
from fcdm_opt.problem.solution import Status, kept_clear
from fcdm_opt.proof import checker
from fcdm_opt.tolerances import Tolerances

ROOT = Path(__file__).parents[2]
MAKERS = ("Check", "_at_most", "_at_least", "_worst", "self._worst")


def _page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def test_references_were_placeholders_in_a_clone(monkeypatch: pytest.MonkeyPatch) -> None:
    """They stand in the pages, and are what the code says; `python docs/hooks/references.py` writes them anew."""
    monkeypatch.syspath_prepend(ROOT / "docs" / "hooks")
    references = importlib.import_module("references")
    pages = [path.name for path in (ROOT / "docs").glob("*.md")]
    assert [name for name in pages if references.written(_page(name)) != _page(name)] == []
    assert all(any(f"<!-- {name} -->" in _page(page) for page in pages) for name in references.TABLES)


def _texts(node: ast.expr) -> list[str]:
    """Return what an expression for a check's name may be, with what is put in as its source: "contact k"."""
    if isinstance(node, ast.IfExp):
        return _texts(node.body) + _texts(node.orelse)
    if isinstance(node, ast.Constant):
        return [str(node.value)]
    if isinstance(node, ast.Call):
        assert ast.unparse(node.func) == kept_clear.__name__, ast.unparse(node)
        return [kept_clear("name")]
    assert isinstance(node, ast.JoinedStr), f"a check's name that this test cannot read: {ast.unparse(node)}"
    text = "".join(
        str(part.value) if isinstance(part, ast.Constant) else f"<{ast.unparse(part.value)}>"
        for part in node.values
        if isinstance(part, ast.Constant | ast.FormattedValue)
    )
    if text == "proof: <Reason(code).name>":
        return [f"proof: {reason.name}" for reason in Reason]
    return [text.replace("<k>", "k").replace("<code>", "n").replace("<keep_out.name>", "name")]


def _emitted(module: ModuleType) -> set[str]:
    """Return the names of all checks that a module makes, read from its source."""
    tree = ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8"))
    found: set[str] = set()
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef) or function.name in MAKERS:
            continue
        named = {
            target.id: statement.value
            for statement in ast.walk(function)
            if isinstance(statement, ast.Assign)
            for target in statement.targets
            if isinstance(target, ast.Name)
        }
        for call in ast.walk(function):
            if isinstance(call, ast.Call) and ast.unparse(call.func) in MAKERS:
                first = call.args[0]
                if isinstance(first, ast.Name) and first.id.isupper():
                    found.add(getattr(module, first.id))
                    continue
                found.update(_texts(named[first.id] if isinstance(first, ast.Name) else first))
    return found


def _listed() -> set[str]:
    """Return the names of checks in the tables of the page."""
    section = _page("certificate.md").split("## The checks")[1].split("## What no check covers")[0]
    cells = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    return {name for cell in cells for name in re.findall(r"`([^`]+)`", cell)}


def test_every_check_is_explained_and_none_that_there_is_not() -> None:
    emitted = _emitted(certificate) | _emitted(checker) | _emitted(multipliers)
    assert len(emitted) > 30  # the source was read
    assert _listed() == emitted


@pytest.mark.parametrize(
    ("file", "case"), [("example1.toml", 1), ("lid.toml", 0), ("bracket.toml", 1), ("bracket_stuck.toml", 0)]
)
def test_checks_of_real_certificates_are_on_the_page(file: str, case: int) -> None:
    problem = fo.load_problems(ROOT / "problems" / file)[case]
    checks = fo.verify(fo.solve(problem, certify=True), proof=True).checks
    plain = [re.sub(r"\b\d+\b", "k", re.sub(r"'[^']*'", "'name'", check.name)) for check in checks]
    assert set(plain) <= _listed()


def test_every_status_is_listed_with_its_advice() -> None:
    page = _page("certificate.md")
    for status in Status:
        assert f"| `{status.name}` | {'yes' if status.found else 'no'} | {status.value} |" in page


def test_every_exit_code_is_explained() -> None:
    table = _page("certificate.md").split("## Exit codes")[1]
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", table, re.MULTILINE)}
    assert codes == set(common.SEVERITY)
    assert ", ".join(map(str, reversed(common.SEVERITY))).replace(", ", ", then ", 1) in table


def test_every_tolerance_has_a_row_with_its_reason() -> None:
    page = _page("accuracy.md")
    for item in fields(Tolerances):
        row = re.search(rf"^\| `{item.name}` \| (\S+) \| (.+) \|$", page, re.MULTILINE)
        assert row, item.name
        assert float(row[1]) == pytest.approx(getattr(Tolerances(), item.name), rel=1e-5)
        assert len(row[2]) > 20, item.name
